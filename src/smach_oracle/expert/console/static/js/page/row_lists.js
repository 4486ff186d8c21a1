// @ts-check
// Long lists, of which the server sends what has changed to pages that look at them.
import { unlessLost } from './connection.js';

/**
 * The rows of a list after a change.
 * @template {{ id: string }} Row
 * @param {Row[] | undefined} old
 * @param {{ all?: true, rows: [before: string, row: Row][], gone?: string[] }} change
 */
export function changed(old, { all, rows, gone = [] }) {
  const left = new Set(gone);
  const list = !old || all ? [] : old.filter((row) => !left.has(row.id));
  const places = new Map(list.map((row, place) => [row.id, place]));
  const fresh = rows.filter(([, row]) => !places.has(row.id));
  for (const [, row] of rows) {
    const place = places.get(row.id);
    if (place !== undefined) list[place] = row;
  }
  for (const [before, row] of fresh) {
    list.splice(before ? list.findIndex(({ id }) => id === before) + 1 : 0, 0, row);
  }
  return list;
}

/** Tells the server which lists are looked at. */
export class Looking {
  /**
   * @param {page.Connection} connection
   * @param {() => server.LookedAt} wanted where what is shown has lists
   */
  constructor(connection, wanted) {
    this.connection = connection;
    this.wanted = wanted;
    /** @type {server.LookedAt} */
    this.told = '';
    document.addEventListener('visibilitychange', () => this.tell());
  }

  /** The server knows nothing of this page yet. */
  connected() {
    this.told = '';
    this.tell();
  }

  tell() {
    const looks = document.hidden ? '' : this.wanted();
    if (looks === this.told || !this.connection.connected) return;
    this.told = looks;
    this.connection.request('look', { at: looks }).catch(unlessLost);
  }
}
