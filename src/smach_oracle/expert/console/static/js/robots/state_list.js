// @ts-check
// A container as a list of its states: for where there is no drawing, and for who prefers it.
import { h } from '../page/dom.js';
import { FAILURE_CLASSES, chip, percent, rateBar } from '../page/format.js';
import { redrawWith } from '../page/redraw.js';
import { activeIn, focusState } from './focus_state.js';

const TITLES = ['State', 'Failure rate', 'Class', 'Ok / failed', 'Leads to'];

export class StateList {
  /** @param {(path: string) => void} onOpen a nested container was chosen */
  constructor(onOpen) {
    this.onOpen = onOpen;
    this.body = h('tbody', {});
    this.seen = ''; // the state that was brought into view
    const titles = TITLES.map((title) => h('th', { scope: 'col' }, title));
    this.root = h('div', { class: 'table-frame' }, h('table', { class: 'states' },
      h('thead', {}, h('tr', {}, titles)), this.body));
  }

  /**
   * @param {string} robot
   * @param {server.Graph} graph
   * @param {machine.MachineState} machine
   * @param {(label: string) => boolean} wanted
   */
  set(robot, graph, machine, wanted = () => true) {
    const states = graph.states.filter(({ label }) => wanted(label));
    const place = robot + '/' + graph.path + '/';
    const other = redrawWith(this.body, [robot, graph, machine, states], () => (
      states.map(({ label, nested }) => this.row(place + label, label, nested, graph, machine))));
    if (other) this.bringIntoView(place, focusState(graph, machine));
  }

  /**
   * The state that failed or is active, once: a person may scroll away from it.
   * @param {string} place
   * @param {string} label
   */
  bringIntoView(place, label) {
    const row = [...this.body.children].find((each) => each.getAttribute('data-id')
      === place + label);
    if (!label || !row || this.seen === place + label || !this.root.clientHeight) return;
    this.seen = place + label;
    // not by scrollIntoView(), which scrolls the page around it, too
    const below = row.getBoundingClientRect().top - this.root.getBoundingClientRect().top;
    this.root.scrollTop += below - this.root.clientHeight / 2;
  }

  /**
   * @param {string} id
   * @param {string} label
   * @param {boolean} nested
   * @param {server.Graph} graph
   * @param {machine.MachineState} machine
   */
  row(id, label, nested, graph, machine) {
    const { path } = graph;
    const learned = machine.rates[path]?.[label];
    const failed = machine.failed[path]?.state === label;
    const active = activeIn(path, machine).includes(label);
    const open = () => this.onOpen(path + '/' + label);
    const name = nested ? h('button', { class: 'link', onclick: open }, label, ' ›') : label;
    return h('tr', { key: id, class: (active ? 'active ' : '') + (failed ? 'failed' : ''),
      'data-id': id },
    h('th', { scope: 'row' }, name, active && chip('active', 'accent'),
      failed && chip('failed', 'bad')),
    h('td', {}, learned ? rateBar(learned.rate) : '–'),
    h('td', {}, learned
      ? chip(FAILURE_CLASSES[learned.class] || '–', 'class-' + learned.class) : '–'),
    h('td', { class: 'number' }, learned ? learned.successes + ' / ' + learned.failures : '–'),
    h('td', {}, leadsTo(label, graph, machine)));
  }
}

/**
 * Where a state leads, and how often it did.
 * @param {string} label
 * @param {server.Graph} graph
 * @param {machine.MachineState} machine
 * @returns {page.Child}
 */
function leadsTo(label, { path, edges, oracle }, machine) {
  const counts = (machine.counts[path] || []).filter(([from]) => from === label);
  const found = edges.filter((edge) => edge.from === label).map(({ outcome, to }) => {
    const taken = counts.find(([, by, where]) => by === outcome && where === to);
    return h('span', { class: 'leads' }, outcome, ' → ', to, taken ? ' ' + percent(taken[4]) : '');
  });
  const failures = counts.filter(([, , to]) => to === oracle);
  const share = failures.reduce((sum, row) => sum + row[4], 0);
  if (share) {
    found.push(h('span', { class: 'leads to-oracle' }, 'failure → ', oracle, ' ', percent(share)));
  }
  return found;
}
