// @ts-check
// Machines that are down: where they stood, how they go on, and what may be changed before that.
import { h } from '../page/dom.js';
import { clock, duration } from '../page/format.js';
import { keep, render } from '../page/redraw.js';
import { DownChanges } from './down_changes.js';

const GOES_ON = 'Goes on when its program is started again. By default it asks a person first.';
const TO_LOOK = 'To look closer, on the computer of its store:';

export class DownList {
  /** @param {page.App} app */
  constructor(app) {
    this.app = app;
    this.root = h('section', { hidden: true });
    /** @type {Map<string, DownChanges>} */
    this.changes = new Map(); // by the key of their rows
  }

  /** Show them as they are now. */
  draw() {
    const rows = this.app.store.get('down') || [];
    for (const key of [...this.changes.keys()]) {
      if (!rows.some((row) => row.key === key && !row.problem)) this.changes.delete(key);
    }
    render(this.root, h('section', { class: 'card down-machines', hidden: !rows.length,
      'aria-label': 'Machines that are down' }, h('h2', {}, 'Down'), rows.map((row) => (
      row.problem ? h('p', { key: row.key, class: 'down-problem' }, row.problem)
        : machineView(row, this.app.store.now(), keep(this.changesOf(row).show(row)))))));
  }

  /** @param {server.DownMachine} row */
  changesOf(row) {
    const known = this.changes.get(row.key);
    if (known) return known;
    const changes = new DownChanges(this.app, row);
    this.changes.set(row.key, changes);
    return changes;
  }
}

/**
 * @param {server.DownMachine} row
 * @param {number} now by the server's clock
 * @param {page.Child} changes
 */
function machineView(row, now, changes) {
  const { key, machine, since, stood, questions, userdata, more_userdata: more } = row;
  return h('details', { key, class: 'down-machine', 'data-machine': machine },
    h('summary', {}, h('strong', {}, machine), h('span', {}, ' down since ' + clock(since) + ' ('
      + (since ? duration(now - since) : '') + '), ' + (stood[stood.length - 1]
      || 'had not begun'))),
    h('div', {}, h('p', {}, GOES_ON),
      h('ul', {}, stood.map((each) => h('li', {}, each)),
        questions.map((each) => h('li', {}, 'question ' + each + ' was open'))),
      h('table', {}, h('tbody', {}, userdata.map(([path, item, text]) => h('tr', {},
        h('td', {}, path), h('td', {}, item), h('td', {}, text))))),
      more > 0 && h('p', { class: 'dim' }, 'and ' + more + ' more')),
    changes, h('p', { class: 'dim' }, row.store + '. ' + TO_LOOK), h('pre', {}, row.command));
}
