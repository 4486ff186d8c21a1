// @ts-check
// One container: its drawing, one of its states with those around, or its list.
import { h, replace, setText } from '../page/dom.js';
import { remember, remembered } from '../page/preferences.js';
import { AroundView } from './around_view.js';
import { activeIn } from './focus_state.js';
import { GraphView } from './graph_view.js';
import { StateList } from './state_list.js';
import { StateSearch } from './state_search.js';

/** @typedef {import('../page/store.js').Store} Store */

const UNKNOWN = 'Nothing is known of this machine. It is shown while its introspection is on.';
const NOT_DRAWN = 'There is no drawing of it, or not yet. Drawings need Graphviz on the console’s '
  + 'machine, and a machine that it can lay out in time.';
const PREFERENCE = 'machine-view';
const MOST_DRAWN = 150; // states, as container_graph.py has it
const READABLE = 60; // states: a drawing of more is not the first thing that is shown
const MOST_LISTED = 25; // states: more are shown one by one, with what is around
/** @typedef {'graph' | 'around' | 'list'} Way */
/** @type {[way: Way, name: string, title: string][]} */
const WAYS = [['graph', 'Graph', 'All states, drawn'],
  ['around', 'Around', 'One state, what leads to it, and where it leads'],
  ['list', 'List', 'All states, one below the other']];

/**
 * Machines as they are now.
 * @param {Store} store
 * @returns {machine.MachineSource}
 */
export function machinesNow(store) {
  return {
    graph: (robot, path) => store.get(`graph ${robot} ${path}`),
    state: (robot) => machineState(store, robot),
  };
}

/**
 * What a robot's section and its open questions say: a page that came late has not heard of the
 * failure.
 * @param {Store} store
 * @param {string} robot
 * @returns {machine.MachineState}
 */
function machineState(store, robot) {
  const live = store.get(`live ${robot}`);
  if (!live) return { active: {}, latest: {}, failed: {}, rates: {}, counts: {}, paths: [] };
  /** @type {machine.MachineState['failed']} */
  const failed = { ...live.failed };
  for (const question of store.questions) {
    const { path, state, running } = question;
    if (question.robot === robot && !running) failed[path] = { state };
  }
  return { ...live, failed };
}

export class MachineView {
  /**
   * @param {machine.MachineSource} source
   * @param {(path: string) => void} onOpen a nested container was chosen
   */
  constructor(source, onOpen) {
    this.source = source;
    this.graph = new GraphView(onOpen);
    this.around = new AroundView(onOpen);
    this.list = new StateList(onOpen);
    this.search = new StateSearch(() => this.update(), (label) => this.find(label));
    this.note = h('p', { class: 'dim note' });
    this.buttons = new Map(WAYS.map(([way, name, title]) => [way,
      h('button', { class: 'tool', title, 'data-way': way, onclick: () => this.prefer(way) },
        name)]));
    this.bar = h('div', { class: 'row wrap machine-bar' }, this.search.root,
      h('span', { class: 'spacer' }),
      h('div', { class: 'row', role: 'group', 'aria-label': 'How the machine is shown' },
        [...this.buttons.values()]));
    this.root = h('div', { class: 'machine-view' });
    this.robot = '';
    this.path = '';
    /** @type {Way | '' | null} */
    this.shown = null;
  }

  /**
   * @param {string} robot
   * @param {string} path
   */
  show(robot, path) {
    this.robot = robot;
    this.path = path;
    this.update();
  }

  get data() { return this.source.graph(this.robot, this.path); }

  /** @param {Way} way */
  prefer(way) {
    remember(PREFERENCE, way);
    this.update();
  }

  /** @param {string} label */
  find(label) {
    this.graph.find(label);
    this.around.choose(label);
  }

  update() {
    const { data } = this;
    const machine = this.source.state(this.robot);
    if (!data) {
      replace(this.root, h('p', { class: 'empty' }, UNKNOWN));
      this.shown = null;
      return;
    }
    const shown = wayOf(data);
    const part = shown && { graph: this.graph, around: this.around, list: this.list }[shown].root;
    if (shown !== this.shown) replace(this.root, this.bar, this.note, part || []);
    this.shown = shown;
    for (const [way, button] of this.buttons) {
      button.setAttribute('aria-pressed', String(way === shown));
      button.hidden = way === 'graph' ? !data.drawn : !data.states.length;
    }
    this.search.set(data);
    setText(this.note, noteOn(data, machine));
    if (shown === 'graph') {
      this.graph.set(this.robot, data);
      this.graph.setState(machine);
    } else if (shown === 'around') this.around.set(this.robot, data, machine);
    else if (shown === 'list') {
      this.list.set(this.robot, data, machine, (label) => this.search.has(label));
    }
  }
}

/**
 * How a container is shown: as this person wants it, else as it can be read; '' where nothing is
 * told.
 * @param {server.Graph} graph
 * @returns {Way | ''}
 */
function wayOf({ drawn, states, refused }) {
  if (refused) return '';
  const wanted = WAYS.find(([way]) => way === remembered(PREFERENCE, ''))?.[0];
  if (wanted && (drawn || wanted !== 'graph')) return wanted;
  if (drawn && states.length <= READABLE) return 'graph';
  return states.length > MOST_LISTED ? 'around' : 'list';
}

/**
 * Why there is no drawing, or no state at all.
 * @param {server.Graph} graph
 * @param {machine.MachineState} machine
 */
function noteOn({ path, drawn, states, refused }, machine) {
  if (refused) {
    const failed = machine.failed[path]?.state;
    const active = activeIn(path, machine).filter((label) => label !== 'None').join(', ');
    return 'It has ' + refused + ' states, which are too many to be shown.'
      + (failed ? ' ' + failed + ' has failed.' : '') + (active ? ' Active: ' + active + '.' : '');
  }
  if (drawn) return '';
  return states.length > MOST_DRAWN
    ? 'It has ' + states.length + ' states. No more than ' + MOST_DRAWN + ' are drawn as a whole.'
    : NOT_DRAWN;
}
