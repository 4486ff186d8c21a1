// @ts-check
// The shapes of a drawn container: states, outcomes, edges, and ORACLE with its rail.
import { svg } from '../page/dom.js';

/**
 * @typedef {object} EdgeShape
 * @property {SVGGElement} group
 * @property {SVGPathElement} line
 * @property {SVGTextElement} label
 * @property {string} from
 * @property {string} to
 * @property {string} outcome '' of the edges of ORACLE
 * @property {boolean} ofOracle
 */
/** @typedef {ReturnType<typeof stateShape>} StateShape */

const RAIL_GAP = 96; // px, from the states to the rail
const RAIL_WIDTH = 64;
const RAIL_LABELS = 420; // px between two labels of the rail
const LOWEST = 90; // px
const ARROWS = ['edge', 'used', 'hot', 'oracle', 'failing'];

/** The heads of edges, by their kinds. */
export function arrowHeads() {
  return svg('defs', {}, ARROWS.map((kind) => svg('marker', { id: 'arrow-' + kind,
    class: 'arrow ' + kind, viewBox: '0 0 8 8', refX: 7, refY: 4, markerWidth: 9, markerHeight: 9,
    markerUnits: 'userSpaceOnUse', orient: 'auto-start-reverse' },
  svg('path', { d: 'M0 0.500L8 4L0 7.500z' }))));
}

/**
 * Where the rail of ORACLE begins, and how large the whole is, px.
 * @param {server.Graph} graph
 */
export function measured({ size, oracle }) {
  const [width, height] = size || [0, 0];
  const rail = width + RAIL_GAP;
  return { rail, width: oracle ? rail + RAIL_WIDTH : width, height: Math.max(height, LOWEST) };
}

/**
 * @param {number[]} points x, y, x, y, ... of Bezier curves, the arrow's tip at the end
 */
function spline(points) {
  if (points.length < 8) return '';
  let path = 'M' + points[0] + ' ' + points[1];
  const curve = points.length - 2;
  for (let i = 2; i + 5 < curve; i += 6) path += 'C' + points.slice(i, i + 6).join(' ');
  return path + 'L' + points[curve] + ' ' + points[curve + 1];
}

/**
 * @param {string} text
 * @param {number} width px
 */
function shorten(text, width) {
  const most = Math.max(4, Math.floor((width - 14) / 8.7));
  return text.length <= most ? text : text.slice(0, most - 1) + '…';
}

/**
 * @param {number} x
 * @param {number} y
 */
function translate(x, y) { return 'translate(' + x + ' ' + y + ')'; }

/**
 * @param {server.GraphEdge} edge
 * @returns {EdgeShape}
 */
export function edgeShape({ from, outcome, to, points, label: place }) {
  const line = svg('path', { class: 'edge', d: spline(points), 'marker-end': 'url(#arrow-edge)' });
  const [x, y] = place || [points[0] || 0, points[1] || 0];
  const label = svg('text', { class: 'edge-label', x, y: y + 4 }, outcome);
  return { group: svg('g', {}, line, label), line, label, from, to, outcome, ofOracle: false };
}

/**
 * A short line from a state to the rail, or back.
 * @param {string} from
 * @param {string} to
 * @param {[x1: number, y1: number, x2: number]} place
 * @param {number} rail
 * @returns {EdgeShape}
 */
function oracleLine(from, to, [x1, y1, x2], rail) {
  const line = svg('path', { class: 'edge oracle-edge',
    d: 'M' + x1 + ' ' + y1 + 'L' + x2 + ' ' + y1 });
  const label = svg('text', { class: 'edge-label oracle-label', x: rail - 8, y: y1 - 4,
    'text-anchor': 'end' });
  const group = svg('g', {}, line, label);
  return { group, line, label, from, to, outcome: '', ofOracle: true };
}

/**
 * All edges of ORACLE.
 * @param {server.Graph} graph
 * @returns {EdgeShape[]}
 */
export function oracleLines({ oracle, states, outcomes, ...graph }) {
  const { rail } = measured({ oracle, states, outcomes, ...graph });
  const ofStates = states.flatMap(({ label, at }, index) => {
    if (!at) return [];
    const [x, y, width] = at;
    const shift = (index % 3 - 1) * 2;
    const side = x + width / 2;
    return [oracleLine(label, oracle, [side, y + 7 + shift, rail], rail),
      oracleLine(oracle, label, [rail, y - 9 + shift, side + 1], rail)];
  });
  const ofOutcomes = outcomes.flatMap(({ label, at }) => (
    at ? [oracleLine(oracle, label, [rail, at[1], at[0] + at[2] / 2 + 1], rail)] : []));
  return [...ofStates, ...ofOutcomes];
}

/**
 * The rail.
 * @param {server.Graph} graph
 * @param {string} id
 */
export function oracleShape(graph, id) {
  const { rail, height } = measured(graph);
  const labels = [];
  for (let y = Math.min(60, height / 2); y < height; y += RAIL_LABELS) {
    labels.push(svg('text', { x: rail + RAIL_WIDTH / 2, y, class: 'oracle-name' },
      shorten(graph.oracle, 80)));
  }
  return svg('g', { class: 'oracle', id },
    svg('rect', { x: rail, y: 0, width: RAIL_WIDTH, height, rx: 12 }), labels);
}

/**
 * An outcome of the container.
 * @param {string} label
 * @param {server.Place} place
 * @param {string} id
 * @param {number} bundled states that lead there by a preemption, whose edges are not drawn
 */
export function outcomeShape(label, [x, y, width, height], id, bundled) {
  const from = 'from ' + bundled + ' states';
  return svg('g', { class: 'outcome', id, transform: translate(x, y) },
    svg('title', {}, label + (bundled ? ', by preemption ' + from : '')),
    svg('rect', { x: -width / 2, y: -height / 2, width, height, rx: height / 2 }),
    svg('text', { y: 4 }, shorten(label, width)),
    bundled > 0 && svg('text', { class: 'bundled', y: -height / 2 - 6 }, from));
}

/**
 * @param {KeyboardEvent} event
 * @param {() => void} open
 */
function openByKey(event, open) {
  if (event.key !== 'Enter' && event.key !== ' ') return;
  event.preventDefault(); // Space would scroll
  open();
}

/**
 * @param {string} label
 * @param {server.Place} place
 * @param {string} id
 * @param {(() => void) | null} open where it is a container itself
 */
export function stateShape(label, [x, y, width, height], id, open) {
  const rate = svg('text', { y: 15, class: 'state-rate' });
  const title = svg('title', {}, label);
  const box = { width, height, rx: 10 };
  const group = svg('g', { class: 'state' + (open ? ' nested' : ''), id, transform: translate(x, y),
    onclick: open, onkeydown: open && ((event) => openByKey(event, open)),
    tabindex: open ? '0' : null, role: open ? 'button' : null },
  title, open && svg('rect', { class: 'behind', x: -width / 2 + 4, y: -height / 2 + 5, ...box }),
  svg('rect', { class: 'box', x: -width / 2, y: -height / 2, ...box }),
  svg('text', { y: -3, class: 'state-name' }, shorten(label, width)), rate,
  svg('g', { class: 'failed-mark', transform: translate(width / 2 - 2, -height / 2 + 2) },
    svg('circle', { r: 9 }), svg('text', { y: 4 }, '!')));
  return { group, rate, title, at: /** @type {[x: number, y: number]} */ ([x, y]) };
}
