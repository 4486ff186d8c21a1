// @ts-check
// One machine that is down: where it stood, and how it goes on.
import { h, setText } from '../page/dom.js';
import { clock } from '../page/format.js';
import { redraw } from '../page/redraw.js';
import { DownChanges } from './down_changes.js';

const GOES_ON = 'Goes on when its program is started again. By default it asks a person first.';
const TO_LOOK = 'To look closer, on the computer of its store:';

export class DownMachineView {
  /**
   * @param {page.App} app
   * @param {server.DownMachine} row
   */
  constructor(app, row) {
    this.key = '';
    this.age = h('span', {});
    this.facts = h('div', {});
    this.changes = new DownChanges(app, row);
    this.root = h('details', { class: 'down-machine', 'data-machine': row.machine },
      h('summary', {}, h('strong', {}, row.machine), this.age), this.facts, this.changes.root,
      h('p', { class: 'dim' }, row.store + '. ' + TO_LOOK), h('pre', {}, row.command));
  }

  /**
   * @param {server.DownMachine} row
   * @param {string} age
   */
  show(row, age) {
    const { since, stood, questions, userdata, more_userdata: more } = row;
    setText(this.age, ' down since ' + clock(since) + ' (' + age + '), '
      + (stood.length ? stood[stood.length - 1] : 'had not begun'));
    this.changes.show(row);
    const key = JSON.stringify(row);
    if (key === this.key) return;
    this.key = key;
    redraw(this.facts, h('p', {}, GOES_ON),
      h('ul', {}, stood.map((each) => h('li', {}, each)),
        questions.map((each) => h('li', {}, 'question ' + each + ' was open'))),
      h('table', {}, h('tbody', {}, userdata.map(([path, item, text]) => h('tr', {},
        h('td', {}, path), h('td', {}, item), h('td', {}, text))))),
      more ? h('p', { class: 'dim' }, 'and ' + more + ' more') : null);
  }
}
