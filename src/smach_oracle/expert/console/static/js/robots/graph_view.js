// @ts-check
// One container drawn from the positions that dot gave the server. ORACLE is a rail at the right
// side: every state's edge to it and back is a short line, pale until it was used.
import { h, svg } from '../page/dom.js';
import { Cards, redrawWith, whenLetGo } from '../page/redraw.js';
import {
  arrowHeads, edgeShape, measured, oracleEdgeShape, oracleLines, oracleShape, outcomeShape,
  stateShape,
} from './graph_shapes.js';
import { activeIn, focusState } from './focus_state.js';
import { GraphMap } from './graph_map.js';
import { CLOSER, GraphViewport } from './graph_viewport.js';

/** @typedef {import('./graph_shapes.js').Taken} Taken */

export class GraphView {
  /** @param {(path: string) => void} onOpen a nested container was chosen */
  constructor(onOpen) {
    this.onOpen = onOpen;
    this.layer = svg('g', {});
    this.drawing = svg('svg', { class: 'graph', role: 'group', tabindex: '0' }, arrowHeads(),
      this.layer);
    this.followButton = h('button', { class: 'tool', title: 'Keep what is active in view',
      onclick: () => this.viewport.setFollow(!this.viewport.follow) }, 'Follow');
    this.map = new GraphMap((at) => this.viewport.showMiddle(at));
    this.root = h('div', { class: 'graph-frame' }, this.drawing, this.map.root, this.tools());
    /** @type {server.GraphState[]} */
    this.states = [];
    this.focus = ''; // the state that failed or is active
    this.found = ''; // the one that a person has searched
    this.key = ''; // of what is drawn
    this.shapes = newShapes();
    /** @type {GraphViewport} */
    this.viewport = new GraphViewport(this);
    this.viewport.setFollow(true);
  }

  tools() {
    return h('div', { class: 'tools' },
      h('button', { class: 'tool', title: 'Closer', 'aria-label': 'Closer',
        onclick: () => this.viewport.zoom(CLOSER) }, '+'),
      h('button', { class: 'tool', title: 'Farther', 'aria-label': 'Farther',
        onclick: () => this.viewport.zoom(1 / CLOSER) }, '−'),
      h('button', { class: 'tool', title: 'All of it',
        onclick: () => this.viewport.fitAll() }, 'Fit'),
      this.followButton);
  }

  /**
   * @param {string} robot
   * @param {server.Graph} graph that is drawn
   * @param {machine.MachineState} machine
   */
  set(robot, graph, machine) {
    const key = JSON.stringify([robot, graph]);
    const focus = focusState(graph, machine);
    const moves = key !== this.key || (this.viewport.follow && focus !== this.focus);
    if (key !== this.key) this.shapes = newShapes();
    Object.assign(this, { key, focus, states: graph.states });
    this.viewport.size = measured(graph);
    this.drawing.setAttribute('aria-label', 'States of ' + graph.path);
    redrawWith(this.layer, [key, machine, this.found], () => (
      this.view(robot + '/' + graph.path + '/', graph, machine)));
    this.map.set(graph, machine);
    if (moves) whenLetGo(this.root, () => this.viewport.place());
  }

  /**
   * @param {string} place with which the ids of its states begin
   * @param {server.Graph} graph
   * @param {machine.MachineState} machine
   * @returns {page.Child[]}
   */
  view(place, graph, machine) {
    const { path, oracle, states, outcomes, bundled } = graph;
    const { shapes, viewport: { size: { rail } } } = this;
    const active = activeIn(path, machine);
    const failed = machine.failed[path]?.state;
    const edges = graph.edges.filter(({ points }) => points.length);
    const taken = takenEdges(machine.counts[path] || [], new Set(edges.map(edgeKey)));
    /** @param {{ from: string, to: string }} edge */
    const isHot = (edge) => isLatest(edge, machine.latest[path], oracle)
      || (edge.to === oracle && edge.from === failed);
    return [
      oracleLines(graph).map((line) => {
        const [key, hot] = [pairKey(line), isHot(line)];
        return shapes.card(key, [taken.get(key), hot], () => (
          oracleEdgeShape(line, rail, taken.get(key), hot, line.to === oracle)));
      }),
      oracle && oracleShape(graph, place + oracle, active.includes(oracle)),
      edges.map((edge) => {
        const [key, hot] = [edgeKey(edge), isHot(edge)];
        return shapes.card(key, [taken.get(key), hot], () => edgeShape(edge, taken.get(key), hot));
      }),
      outcomes.map(({ label, at }) => (
        at && outcomeShape(label, at, place + label, bundled[label] || 0))),
      states.map(({ label, nested, at }) => {
        if (!at) return null;
        const kinds = [active.includes(label) ? 'active' : '', label === failed ? 'failed' : '',
          label === this.found ? 'found' : ''];
        const learned = machine.rates[path]?.[label];
        const open = nested ? () => this.onOpen(path + '/' + label) : null;
        return shapes.card(label, [learned, kinds], () => (
          stateShape(label, at, place + label, open, learned, kinds)));
      })];
  }

  /**
   * Bring a state into view.
   * @param {string} label
   */
  find(label) {
    this.found = label;
    const at = this.states.find((each) => each.label === label)?.at;
    if (at) this.viewport.showMiddle([at[0], at[1]]);
  }

  /** Where what failed or is active is, else the first state. */
  get focusPlace() {
    const shown = this.states.filter(({ at }) => at);
    return (shown.find(({ label }) => label === this.focus) || shown[0])?.at || [0, 0];
  }
}

/** An element for each state and each edge of a drawing. */
function newShapes() { return new Cards(() => svg('g', {})); }

/**
 * Whether an edge is the transition that was made last.
 * @param {{ from: string, to: string }} edge
 * @param {server.LatestTransition | undefined} latest
 * @param {string} oracle
 */
function isLatest({ from, to }, latest, oracle) {
  return latest?.[1] === to && from === (latest[0] || oracle);
}

/**
 * How often edges were taken, by their keys. Those that are not drawn are of ORACLE, or are not
 * shown.
 * @param {server.TransitionCount[]} counts
 * @param {Set<string>} drawn keys
 */
function takenEdges(counts, drawn) {
  /** @type {Map<string, Taken>} */
  const found = new Map();
  for (const [from, outcome, to, number, share] of counts) {
    const own = edgeKey({ from, outcome, to });
    const key = drawn.has(own) ? own : pairKey({ from, to });
    const before = found.get(key) || { times: 0, share: 0 };
    found.set(key, { times: before.times + number, share: before.share + share });
  }
  return found;
}

/** @param {{ from: string, outcome: string, to: string }} edge */
function edgeKey({ from, outcome, to }) { return JSON.stringify([from, outcome, to]); }

/**
 * Of an edge of ORACLE, which stands for all outcomes.
 * @param {{ from: string, to: string }} edge
 */
function pairKey({ from, to }) { return JSON.stringify([from, to]); }
