// @ts-check
// Machines that are down: where they stood, how they go on, and what may be changed before that.
import { h } from '../page/dom.js';
import { duration } from '../page/format.js';
import { arrange } from '../page/redraw.js';
import { DownMachineView } from './down_machine.js';

export class DownList {
  /** @param {page.App} app */
  constructor(app) {
    this.app = app;
    this.root = h('section', { class: 'card down-machines', 'aria-label': 'Machines that are down',
      hidden: true });
    this.title = h('h2', {}, 'Down');
    this.shown = '';
    /** @type {Map<string, DownMachineView>} */
    this.views = new Map(); // by the key of their rows
  }

  /** Show them as they are now. */
  show() {
    const rows = this.app.store.get('down') || [];
    this.root.hidden = !rows.length;
    const now = this.app.store.now();
    for (const row of rows) {
      if (!row.problem) this.viewOf(row).show(row, row.since ? duration(now - row.since) : '');
    }
    const shown = JSON.stringify(rows.map(({ key, problem }) => [key, problem]));
    if (shown === this.shown) return;
    this.shown = shown;
    for (const key of [...this.views.keys()]) {
      if (!rows.some((row) => row.key === key && !row.problem)) this.views.delete(key);
    }
    arrange(this.root, this.title, rows.map((row) => (
      row.problem ? h('p', { class: 'down-problem' }, row.problem) : this.viewOf(row).root)));
  }

  /** @param {server.DownMachine} row */
  viewOf(row) {
    const known = this.views.get(row.key);
    if (known) return known;
    const view = new DownMachineView(this.app, row);
    this.views.set(row.key, view);
    return view;
  }
}
