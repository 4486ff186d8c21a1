// @ts-check
// Long lists, of which the server sends what has changed to pages that look at them.
import { unlessLost } from './connection.js';

/** @typedef {import('./connection.js').Connection} Connection */
/** @typedef {import('../server').Trial} Trial */

/**
 * A list after a change.
 * @template {{ trials: Trial[] }} List
 * @param {List | undefined} list
 * @param {import('../server').ListChange<List>} change
 * @returns {List}
 */
export function changed(list, { all, rest, rows, gone = [] }) {
  const left = new Set(gone);
  const trials = !list || all ? [] : list.trials.filter((trial) => !left.has(trial.id));
  const places = new Map(trials.map((trial, place) => [trial.id, place]));
  const fresh = rows.filter(([, row]) => !places.has(row.id));
  for (const [, row] of rows) {
    const place = places.get(row.id);
    if (place !== undefined) trials[place] = row;
  }
  for (const [before, row] of fresh) {
    trials.splice(before ? trials.findIndex(({ id }) => id === before) + 1 : 0, 0, row);
  }
  return /** @type {List} */ ({ ...list, ...rest, trials });
}

/** Tells the server whether the lists are looked at. */
export class Looking {
  /**
   * @param {Connection} connection
   * @param {() => boolean} wanted whether what is shown has them
   */
  constructor(connection, wanted) {
    this.connection = connection;
    this.wanted = wanted;
    this.told = false;
    document.addEventListener('visibilitychange', () => this.tell());
  }

  /** The server knows nothing of this page yet. */
  connected() {
    this.told = false;
    this.tell();
  }

  tell() {
    const looks = this.wanted() && !document.hidden;
    if (looks === this.told || !this.connection.connected) return;
    this.told = looks;
    this.connection.request('look', { at: looks ? 'trials' : '' }).catch(unlessLost);
  }
}
