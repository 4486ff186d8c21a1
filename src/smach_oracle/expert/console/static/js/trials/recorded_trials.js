// @ts-check
// Trials of bags: what the server has read of them, and one that is opened. A trial of a bag is
// known by the server's number alone.
import { h } from '../page/dom.js';
import { counted } from '../page/format.js';

/** @type {server.BagOverview} */
const NONE = { trials: [], table: [], note: '', broken: [], waiting: 0 };
const LOST = 'The connection was lost; choose the trial again.';

export class RecordedTrials {
  /**
   * @param {page.App} app
   * @param {() => void} onOpen what was opened is there, or cannot be had
   */
  constructor(app, onOpen) {
    this.app = app;
    this.onOpen = onOpen;
    /** @type {(server.RecordedTrial & { number: number }) | null} */
    this.opened = null;
    this.problem = '';
    this.wanted = -1; // number of the trial that is being opened
  }

  get overview() { return this.app.store.get('bags') || NONE; }

  /** @param {number} number */
  async open(number) {
    this.problem = '';
    this.wanted = number;
    if (this.opened && this.opened.number === number) {
      this.onOpen();
      return;
    }
    let problem = '';
    let found = null;
    try {
      const answer = await this.app.connection.fetch('recorded/' + number);
      if (answer.ok) found = await answer.json();
      else if (answer.status === 422) problem = await answer.text();
      else problem = 'The bag cannot be had (' + answer.status + ').';
    } catch (err) {
      problem = LOST;
    }
    if (this.wanted !== number) return; // another one meanwhile
    if (found) this.opened = { ...found, number };
    this.problem = problem;
    this.onOpen();
  }
}

/**
 * What is to be said of bags.
 * @param {server.BagOverview} overview
 * @returns {page.Child[]}
 */
export function bagNotes({ note, broken, waiting }) {
  return [waiting > 0 && h('p', { class: 'dim', role: 'status' },
    'Reading bags: ' + waiting + (waiting === 1 ? ' is' : ' are') + ' still to be read.'),
  note && h('p', { class: 'dim' }, note),
  broken.length > 0 && h('details', { class: 'broken-bags' },
    h('summary', {}, counted(broken.length, 'bag') + ' could not be read'),
    h('ul', {}, broken.map(({ name, reason }) => (
      h('li', {}, h('strong', {}, name), ': ', reason)))))].filter(Boolean);
}
