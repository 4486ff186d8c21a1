// A container as a list of its states: for where there is no drawing, and for who prefers it.
import { h, redraw } from './dom.js';
import { CLASSES, chip, percent, rateBar } from './format.js';

export class StateList {
  constructor(onOpen) {
    this.onOpen = onOpen;
    this.body = h('tbody', {});
    this.root = h('div', { class: 'table-frame' }, h('table', { class: 'states' },
      h('thead', {}, h('tr', {}, ['State', 'Failure rate', 'Class', 'Ok / failed', 'Leads to'].map((title) => h('th', { scope: 'col' }, title)))),
      this.body));
  }

  set(robot, data, live) {
    const key = JSON.stringify([robot, data, live]);
    if (key === this.key) return;
    this.key = key;
    redraw(this.body, data ? data.states.map((state) => this.row(robot, data, live || {}, state)) : []);
  }

  row(robot, data, live, { label, nested }) {
    const path = data.path;
    const at = (name, otherwise) => (live[name] && live[name][path]) || otherwise;
    const learned = at('rates', {})[label];
    const failed = at('failed', {}).state === label;
    const active = live.alive && at('active', []).includes(label);
    const counts = at('counts', []).filter(([from]) => from === label);
    const edges = data.edges.filter((edge) => edge.from === label).map((edge) => {
      const taken = counts.find(([, outcome, to]) => outcome === edge.outcome && to === edge.to);
      return h('span', { class: 'leads' }, edge.outcome, ' → ', edge.to, taken ? ' ' + percent(taken[4]) : '');
    });
    const recovered = counts.filter(([, , to]) => to === data.oracle).reduce((sum, row) => sum + row[4], 0);
    if (recovered) edges.push(h('span', { class: 'leads to-oracle' }, 'failure → ', data.oracle, ' ', percent(recovered)));
    const id = robot + '/' + path + '/' + label;
    return h('tr', { key: id, class: (active ? 'active ' : '') + (failed ? 'failed' : ''), 'data-id': id },
      h('th', { scope: 'row' }, nested ? h('button', { class: 'link', onclick: () => this.onOpen(path + '/' + label) }, label, ' ›') : label,
        active && chip('active', 'accent'), failed && chip('failed', 'bad')),
      h('td', {}, learned ? rateBar(learned.rate) : '–'),
      h('td', {}, learned ? chip(CLASSES[learned.class] || '–', 'class-' + learned.class) : '–'),
      h('td', { class: 'number' }, learned ? learned.successes + ' / ' + learned.failures : '–'),
      h('td', {}, edges));
  }
}
