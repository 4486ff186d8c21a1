// @ts-check
// One container: its drawing, or its list.
import { h, replace, setText } from '../page/dom.js';
import { GraphView } from './graph_view.js';
import { StateList } from './state_list.js';

/** @typedef {import('../page/store.js').Store} Store */
/** @typedef {import('./types').MachineSource} MachineSource */
/** @typedef {import('./types').MachineState} MachineState */

const UNKNOWN = 'Nothing is known of this machine. It is shown while its introspection is on.';
const NOT_DRAWN = 'Shown as a list: there is no drawing of it, or not yet. Drawings need Graphviz '
  + 'on the console’s machine, and a machine that it can lay out in time.';

/**
 * Machines as they are now.
 * @param {Store} store
 * @returns {MachineSource}
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
 * @returns {MachineState}
 */
function machineState(store, robot) {
  const live = store.get(`live ${robot}`);
  if (!live) return { active: {}, latest: {}, failed: {}, rates: {}, counts: {}, paths: [] };
  /** @type {MachineState['failed']} */
  const failed = { ...live.failed };
  for (const question of store.questions) {
    const { path, state, running } = question;
    if (question.robot === robot && !running) failed[path] = { state };
  }
  return { ...live, failed };
}

export class MachineView {
  /**
   * @param {MachineSource} source
   * @param {(path: string) => void} onOpen a nested container was chosen
   */
  constructor(source, onOpen) {
    this.source = source;
    this.graph = new GraphView(onOpen);
    this.list = new StateList(onOpen);
    this.prefersList = false;
    this.note = h('p', { class: 'dim note' });
    this.root = h('div', { class: 'machine-view' });
    this.robot = '';
    this.path = '';
    this.shown = '';
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

  /** Whether there is a choice between a drawing and a list. */
  get drawable() { return Boolean(this.data?.drawn); }

  update() {
    const { data } = this;
    const machine = this.source.state(this.robot);
    if (!data) {
      replace(this.root, h('p', { class: 'empty' }, UNKNOWN));
      this.shown = '';
      return;
    }
    const drawn = data.drawn && !this.prefersList;
    const shown = drawn ? 'graph' : 'list';
    const parts = drawn ? this.graph.root : [this.note, this.list.root];
    if (shown !== this.shown) replace(this.root, parts);
    this.shown = shown;
    setText(this.note, data.drawn || this.prefersList ? '' : NOT_DRAWN);
    if (drawn) {
      this.graph.set(this.robot, data);
      this.graph.setState(machine);
    } else {
      this.list.set(this.robot, data, machine);
    }
  }
}
