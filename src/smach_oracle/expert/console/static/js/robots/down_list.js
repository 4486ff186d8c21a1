// @ts-check
// Machines that are down: where they stood, and how they go on. Nothing is changed from here.
import { h } from '../page/dom.js';
import { clock, duration } from '../page/format.js';
import { redraw } from '../page/redraw.js';

/** @typedef {import('../page/types').App} App */
/** @typedef {import('../down').DownMachine} DownMachine */

const GOES_ON = 'Goes on when its program is started again. By default it asks a person first.';
const TO_CHANGE = 'To look, and to change it before that (edit, goto, drop), on the computer of '
  + 'its store:';

export class DownList {
  /** @param {App} app */
  constructor(app) {
    this.app = app;
    this.root = h('section', { class: 'card down-machines', 'aria-label': 'Machines that are down',
      hidden: true });
    this.shown = '';
  }

  /** Show them as they are now. */
  show() {
    const rows = this.app.store.get('down') || [];
    this.root.hidden = !rows.length;
    const now = this.app.store.now();
    const ages = rows.map(({ since }) => (since ? duration(now - since) : ''));
    const key = JSON.stringify([rows, ages]);
    if (key === this.shown) return;
    this.shown = key;
    redraw(this.root, [h('h2', { key: 'title' }, 'Down'),
      rows.map((row, index) => (row.problem ? problem(row) : machine(row, ages[index])))]);
  }
}

/** @param {DownMachine} row */
function problem({ key, problem: why }) {
  return h('p', { key, class: 'down-problem' }, why);
}

/**
 * @param {DownMachine} row
 * @param {string} age
 */
function machine(row, age) {
  const { key, store, machine: name, since, stood, questions, userdata, command } = row;
  return h('details', { key, class: 'down-machine', 'data-machine': name },
    h('summary', {}, h('strong', {}, name), ' down since ' + clock(since) + ' (' + age + '), '
      + (stood.length ? stood[stood.length - 1] : 'had not begun')),
    h('p', {}, GOES_ON),
    h('ul', {}, stood.map((each) => h('li', {}, each)),
      questions.map((each) => h('li', {}, 'question ' + each + ' was open'))),
    h('table', {}, h('tbody', {}, userdata.map(([path, item, text]) => h('tr', {},
      h('td', {}, path), h('td', {}, item), h('td', {}, text))))),
    row.more_userdata ? h('p', { class: 'dim' }, 'and ' + row.more_userdata + ' more') : null,
    h('p', { class: 'dim' }, store + '. ' + TO_CHANGE), h('pre', {}, command));
}
