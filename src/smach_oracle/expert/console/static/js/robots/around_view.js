// @ts-check
// One state of a container, what leads to it and where it leads: for machines that are too large to
// be drawn as a whole. It follows what fails or is active until a person chooses a state.
import { h } from '../page/dom.js';
import { FAILURE_CLASSES, chip, counted, percent, rateBar, times } from '../page/format.js';
import { redrawWith } from '../page/redraw.js';
import { activeIn, focusState } from './focus_state.js';

/**
 * @typedef {object} Way a transition, as a row
 * @property {string} label of the state at its other end
 * @property {string} outcome
 * @property {number} times how often it was taken
 * @property {number} share of all that left its source
 */

const MOST_WAYS = 40; // of each side

export class AroundView {
  /**
   * @param {(path: string) => void} onOpen a nested container was chosen
   * @param {() => void} onChoice a state was chosen
   */
  constructor(onOpen, onChoice) {
    this.onOpen = onOpen;
    this.onChoice = onChoice;
    this.root = h('div', { class: 'around' });
    this.chosen = ''; // by a person; '': it follows
    this.place = ''; // robot and path
  }

  /**
   * @param {string} label '': follow
   */
  choose(label) {
    this.chosen = label;
    this.onChoice();
  }

  /**
   * @param {string} robot
   * @param {server.Graph} graph
   * @param {machine.MachineState} machine
   */
  set(robot, graph, machine) {
    const place = robot + ' ' + graph.path;
    if (place !== this.place) this.chosen = '';
    this.place = place;
    if (!graph.states.some(({ label }) => label === this.chosen)) this.chosen = '';
    const label = this.chosen || focusState(graph, machine) || graph.states[0]?.label || '';
    redrawWith(this.root, [label, graph, machine, this.chosen], () => [
      h('section', {}, h('h3', {}, 'Leads here'),
        h('ul', { class: 'ways' }, this.rows(waysOf(label, false, graph, machine), graph))),
      h('section', { class: 'around-middle' }, h('div', { class: 'around-state' },
        stateFacts(robot, label, graph, machine, this.onOpen)),
      h('button', { class: 'tool', title: 'Show what fails or is active',
        'aria-pressed': !this.chosen, onclick: () => this.choose('') }, 'Follow')),
      h('section', {}, h('h3', {}, 'Leads to'),
        h('ul', { class: 'ways' }, this.rows(waysOf(label, true, graph, machine), graph)))]);
  }

  /**
   * @param {Way[]} ways
   * @param {server.Graph} graph
   * @returns {page.Child[]}
   */
  rows(ways, { states, oracle }) {
    if (!ways.length) return [h('li', { class: 'dim' }, 'nothing')];
    const shown = ways.slice(0, MOST_WAYS).map((way) => {
      const inside = states.some(({ label }) => label === way.label);
      const name = inside
        ? h('button', { class: 'link', onclick: () => this.choose(way.label) }, way.label)
        : h('span', { class: way.label === oracle ? 'to-oracle' : 'end' }, way.label);
      return h('li', { key: way.label + ' ' + way.outcome, class: way.times ? 'used' : '' }, name,
        h('span', { class: 'dim' }, ' ', way.outcome, way.times ? ' ' + percent(way.share) : ''));
    });
    const left = ways.length - shown.length;
    return [...shown, left > 0 && h('li', { class: 'dim' }, 'and ' + counted(left, 'other'))];
  }
}

/**
 * @param {string} robot
 * @param {string} label
 * @param {server.Graph} graph
 * @param {machine.MachineState} machine
 * @param {(path: string) => void} onOpen
 * @returns {page.Child[]}
 */
function stateFacts(robot, label, { path, states }, machine, onOpen) {
  const learned = machine.rates[path]?.[label];
  const nested = states.some((state) => state.label === label && state.nested);
  const runs = learned ? learned.successes + learned.failures : 0;
  return [
    h('h3', { class: 'around-name', 'data-id': robot + '/' + path + '/' + label }, label),
    h('p', { class: 'chips' },
      machine.failed[path]?.state === label && chip('failed', 'bad'),
      activeIn(path, machine).includes(label) && chip('active', 'accent'),
      learned && chip(FAILURE_CLASSES[learned.class] || '–', 'class-' + learned.class)),
    learned && h('p', {}, rateBar(learned.rate), h('span', { class: 'dim' },
      ' failed ' + (learned.failures ? times(learned.failures) : 'never') + ' of ' + runs)),
    nested && h('button', { class: 'link', onclick: () => onOpen(path + '/' + label) },
      'Look into it ›'),
  ];
}

/**
 * The ways that lead from a state, or to it: each once, those that were taken most first.
 * @param {string} label
 * @param {boolean} onward from it
 * @param {server.Graph} graph
 * @param {machine.MachineState} machine
 */
function waysOf(label, onward, { path, edges }, machine) {
  const known = edges.map(({ from, outcome, to }) => ({ from, outcome, to, times: 0, share: 0 }));
  const taken = (machine.counts[path] || []).map(([from, outcome, to, number, share]) => (
    { from, outcome, to, times: number, share }));
  /** @type {Map<string, Way>} */
  const found = new Map();
  for (const { from, to, ...way } of [...known, ...taken]) {
    const [here, there] = onward ? [from, to] : [to, from];
    const key = JSON.stringify([there, way.outcome]);
    if (here === label && (!found.has(key) || way.times)) found.set(key, { label: there, ...way });
  }
  return [...found.values()].sort((one, two) => two.times - one.times);
}
