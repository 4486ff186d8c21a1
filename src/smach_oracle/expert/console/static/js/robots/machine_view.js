// @ts-check
// One container: its drawing, one of its states with those around, or its list.
import { h } from '../page/dom.js';
import { remember, remembered } from '../page/preferences.js';
import { keep, render } from '../page/redraw.js';
import { AroundView } from './around_view.js';
import { activeIn } from './focus_state.js';
import { GraphView } from './graph_view.js';
import { StateList } from './state_list.js';
import { StateSearch } from './state_search.js';

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
 * @param {page.Store} store
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
 * @param {page.Store} store
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
   * @param {() => machine.Place} placeNow which container is shown
   * @param {(path: string) => void} onOpen a nested container was chosen
   */
  constructor(source, placeNow, onOpen) {
    this.source = source;
    this.placeNow = placeNow;
    this.graph = new GraphView(onOpen);
    this.around = new AroundView(onOpen, () => this.draw());
    this.list = new StateList(onOpen);
    this.search = new StateSearch(() => this.draw(), (label) => this.find(label));
    this.root = h('div', {});
  }

  /** @param {Way} way */
  prefer(way) {
    remember(PREFERENCE, way);
    this.draw();
  }

  /** @param {string} label */
  find(label) {
    this.graph.find(label);
    this.around.choose(label);
  }

  draw() {
    const { robot, path } = this.placeNow();
    const data = this.source.graph(robot, path);
    const machine = this.source.state(robot);
    const shown = data ? wayOf(data) : '';
    if (data) this.search.set(data);
    render(this.root, h('div', { class: 'machine-view' }, data ? this.view(data, machine, shown)
      : h('p', { class: 'empty' }, UNKNOWN)));
    if (data && shown) this[shown].set(robot, data, machine, (label) => this.search.has(label));
  }

  /**
   * @param {server.Graph} data
   * @param {machine.MachineState} machine
   * @param {Way | ''} shown
   * @returns {page.Child[]}
   */
  view(data, machine, shown) {
    return [h('div', { class: 'row wrap machine-bar' }, keep(this.search.root),
      h('span', { class: 'spacer' }),
      h('div', { class: 'row', role: 'group', 'aria-label': 'How the machine is shown' },
        WAYS.map(([way, name, title]) => h('button', { class: 'tool', title, 'data-way': way,
          'aria-pressed': way === shown, hidden: way === 'graph' ? !data.drawn
            : !data.states.length, onclick: () => this.prefer(way) }, name)))),
    h('p', { class: 'dim note' }, noteOn(data, machine)), shown && keep(this[shown].root)];
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
