// @ts-check
// One container drawn from the positions that dot gave the server. ORACLE is a rail at the right
// side: every state's edge to it and back is a short line, pale until it was used.
import { h, svg } from '../page/dom.js';
import { hue, percent, times } from '../page/format.js';
import { whenLetGo } from '../page/redraw.js';
import {
  arrowHeads, edgeShape, measured, oracleLines, oracleShape, outcomeShape, stateShape,
} from './graph_shapes.js';
import { activeIn } from './focus_state.js';
import { takeGraphKeys } from './graph_keys.js';
import { GraphMap } from './graph_map.js';
import { GraphViewport } from './graph_viewport.js';

/** @typedef {import('./graph_shapes.js').EdgeShape} EdgeShape */
/** @typedef {import('./graph_shapes.js').StateShape} StateShape */
/** @typedef {{ times: number, share: number }} Taken how often an edge was */

const CLOSER = 1.3;

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
    this.robot = '';
    /** @type {server.Graph | null} */
    this.graph = null;
    this.key = ''; // of what is drawn
    this.focusKey = ''; // of what is in view
    /** @type {Map<string, StateShape>} */
    this.states = new Map(); // by label
    /** @type {Map<string, EdgeShape>} */
    this.edges = new Map();
    /** @type {SVGGElement | null} */
    this.oracle = null;
    /** @type {GraphViewport} */
    this.viewport = new GraphViewport(this);
    this.viewport.setFollow(true);
    takeGraphKeys(this.drawing, this.viewport);
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
   * @param {server.Graph} graph
   */
  set(robot, graph) {
    const key = JSON.stringify([robot, graph]);
    if (key === this.key) return;
    this.key = key;
    this.robot = robot;
    this.graph = graph;
    this.layer.replaceChildren();
    this.states.clear();
    this.edges.clear();
    this.oracle = null;
    this.focusKey = '';
    this.drawing.setAttribute('aria-label', 'States of ' + graph.path);
    this.viewport.size = graph.drawn ? measured(graph) : null;
    if (!graph.drawn) return;
    this.draw(graph);
    this.viewport.place();
  }

  /** @param {server.Graph} graph */
  draw(graph) {
    /** @param {string} label */
    const id = (label) => this.robot + '/' + graph.path + '/' + label;
    if (graph.oracle) {
      for (const line of oracleLines(graph)) this.addEdge(pairKey(line.from, line.to), line);
      this.oracle = oracleShape(graph, id(graph.oracle));
      this.layer.append(this.oracle);
    }
    for (const edge of graph.edges) {
      const key = edgeKey(edge.from, edge.outcome, edge.to);
      if (edge.points.length) this.addEdge(key, edgeShape(edge));
    }
    for (const { label, at } of graph.outcomes) {
      const bundled = graph.bundled[label];
      if (at) this.layer.append(outcomeShape(label, at, id(label), bundled || 0));
    }
    for (const { label, nested, at } of graph.states) {
      if (!at) continue;
      const open = nested ? () => this.onOpen(graph.path + '/' + label) : null;
      const state = stateShape(label, at, id(label), open);
      this.states.set(label, state);
      this.layer.append(state.group);
    }
    this.map.set(graph);
  }

  /**
   * Bring a state into view.
   * @param {string} label
   */
  find(label) {
    for (const [each, { group }] of this.states) group.classList.toggle('found', each === label);
    const state = this.states.get(label);
    if (state) this.viewport.showMiddle(state.at);
  }

  /**
   * @param {string} key
   * @param {EdgeShape} edge
   */
  addEdge(key, edge) {
    this.edges.set(key, edge);
    this.layer.append(edge.group);
  }

  /**
   * What is active, learned and counted.
   * @param {machine.MachineState} machine
   */
  setState(machine) {
    if (!this.graph || !this.graph.drawn) return;
    const { path, oracle } = this.graph;
    const active = activeIn(path, machine);
    const failed = machine.failed[path]?.state || '';
    const rates = machine.rates[path] || {};
    for (const [label, state] of this.states) {
      state.group.classList.toggle('active', active.includes(label));
      state.group.classList.toggle('failed', label === failed);
      showRate(state, label, rates[label]);
    }
    if (this.oracle) this.oracle.classList.toggle('active', active.includes(oracle));
    this.map.mark(failed, active);
    this.showCounts(machine.counts[path] || [], machine.latest[path], failed);
    const focus = failed || active.find((label) => this.states.has(label)) || '';
    const key = focus + ' ' + this.viewport.follow;
    if (this.viewport.follow && key !== this.focusKey) {
      this.focusKey = key;
      whenLetGo(this.layer, () => this.viewport.place());
    }
  }

  /**
   * Where the failed state is, else an active one, else the first.
   * @returns {[x: number, y: number]}
   */
  get focus() {
    const states = [...this.states.values()];
    /** @param {string} kind */
    const first = (kind) => states.find((state) => state.group.classList.contains(kind));
    const found = first('failed') || first('active') || states[0];
    return found ? found.at : [0, 0];
  }

  /**
   * @param {server.TransitionCount[]} counts
   * @param {[from: string, to: string] | undefined} latest
   * @param {string} failed
   */
  showCounts(counts, latest, failed) {
    const taken = this.takenEdges(counts);
    const oracle = this.graph ? this.graph.oracle : '';
    const [latestFrom, latestTo] = latest || [undefined, undefined];
    for (const [key, edge] of this.edges) {
      const { from, to } = edge;
      const hot = (latestFrom === from && latestTo === to) || (to === oracle && from === failed)
        || (latestFrom === '' && from === oracle && to === latestTo);
      showEdge(edge, taken.get(key), hot, to === oracle);
    }
  }

  /**
   * By the keys of edges.
   * @param {server.TransitionCount[]} counts
   */
  takenEdges(counts) {
    /** @type {Map<string, Taken>} */
    const found = new Map();
    for (const [from, outcome, to, number, share] of counts) {
      const own = edgeKey(from, outcome, to);
      const key = this.edges.has(own) ? own : pairKey(from, to);
      const before = found.get(key) || { times: 0, share: 0 };
      found.set(key, { times: before.times + number, share: before.share + share });
    }
    return found;
  }
}

/**
 * @param {string} from
 * @param {string} outcome
 * @param {string} to
 */
function edgeKey(from, outcome, to) { return JSON.stringify([from, outcome, to]); }

/**
 * Of an edge of ORACLE, which stands for all outcomes.
 * @param {string} from
 * @param {string} to
 */
function pairKey(from, to) { return JSON.stringify([from, to]); }

/**
 * @param {StateShape} state
 * @param {string} label
 * @param {machine.ShownRate | undefined} learned
 */
function showRate({ group, rate, title }, label, learned) {
  const known = Boolean(learned && learned.rate !== null);
  group.classList.toggle('known', known);
  if (!learned || learned.rate === null) return;
  group.style.setProperty('--hue', String(hue(learned.rate)));
  const { failures, successes } = learned;
  const text = `failed ${failures}/${failures + successes} · est. ${percent(learned.rate)}`;
  if (rate.textContent !== text) {
    rate.textContent = text;
    title.textContent = label + ': ' + text;
  }
}

/**
 * @param {EdgeShape} edge
 * @param {Taken | undefined} taken
 * @param {boolean} hot it was taken last
 * @param {boolean} toOracle
 */
function showEdge(edge, taken, hot, toOracle) {
  const { group, line, label, from, to, ofOracle } = edge;
  group.classList.toggle('used', Boolean(taken));
  group.classList.toggle('hot', hot);
  const arrow = !ofOracle || taken ? 'url(#arrow-' + arrowOf(edge, taken, hot) + ')' : '';
  line.setAttribute('marker-end', arrow);
  const text = edgeText(edge, taken, toOracle);
  if (label.textContent === text) return;
  label.textContent = text;
  const title = taken ? [svg('title', {}, from + ' → ' + to + ', ' + times(taken.times))] : [];
  group.replaceChildren(line, label, ...title);
}

/**
 * @param {EdgeShape} edge
 * @param {Taken | undefined} taken
 * @param {boolean} hot
 */
function arrowOf({ ofOracle }, taken, hot) {
  if (ofOracle) return hot ? 'failing' : 'oracle';
  if (hot) return 'hot';
  return taken ? 'used' : 'edge';
}

/**
 * @param {EdgeShape} edge
 * @param {Taken | undefined} taken
 * @param {boolean} toOracle
 */
function edgeText({ ofOracle, outcome }, taken, toOracle) {
  if (!ofOracle) return outcome + (taken ? ' ' + percent(taken.share) : '');
  if (!taken) return '';
  return taken.times + (toOracle ? '× failed' : '×');
}
