// @ts-check
// The shapes of a drawn container: states, outcomes, edges, and ORACLE with its rail.
import { svg } from '../page/dom.js';
import { hue, percent, times } from '../page/format.js';

/** @typedef {{ times: number, share: number }} Taken how often an edge was */
/** @typedef {{ from: string, to: string, y: number, x: [number, number] }} OracleLine */

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
 * A transition that dot has laid.
 * @param {server.GraphEdge} edge
 * @param {Taken | undefined} taken
 * @param {boolean} hot it was taken last
 */
export function edgeShape({ from, outcome, to, points, label }, taken, hot) {
  const [x, y] = label || points;
  const arrow = hot ? 'hot' : taken ? 'used' : 'edge';
  return edgeGroup(from + ' → ' + to, taken, hot,
    svg('path', { class: 'edge', d: spline(points), 'marker-end': 'url(#arrow-' + arrow + ')' }),
    svg('text', { class: 'edge-label', x, y: y + 4 },
      outcome + (taken ? ' ' + percent(taken.share) : '')));
}

/**
 * A short line from a state to the rail, or back: it stands for all outcomes.
 * @param {OracleLine} line
 * @param {number} rail
 * @param {Taken | undefined} taken
 * @param {boolean} hot it was taken last
 * @param {boolean} toOracle
 */
export function oracleEdgeShape({ from, to, y, x }, rail, taken, hot, toOracle) {
  const arrow = 'url(#arrow-' + (hot ? 'failing' : 'oracle') + ')';
  return edgeGroup(from + ' → ' + to, taken, hot,
    svg('path', { class: 'edge oracle-edge', d: 'M' + x[0] + ' ' + y + 'L' + x[1] + ' ' + y,
      'marker-end': taken && arrow }),
    svg('text', { class: 'edge-label oracle-label', x: rail - 8, y: y - 4, 'text-anchor': 'end' },
      taken && taken.times + (toOracle ? '× failed' : '×')));
}

/**
 * @param {string} title
 * @param {Taken | undefined} taken
 * @param {boolean} hot
 * @param {SVGElement[]} shapes
 */
function edgeGroup(title, taken, hot, ...shapes) {
  return svg('g', { class: (taken ? 'used ' : '') + (hot ? 'hot' : '') }, shapes,
    taken && svg('title', {}, title + ', ' + times(taken.times)));
}

/**
 * All edges of ORACLE.
 * @param {server.Graph} graph
 * @returns {OracleLine[]}
 */
export function oracleLines(graph) {
  const { oracle, states, outcomes } = graph;
  if (!oracle) return [];
  const { rail } = measured(graph);
  const ofStates = states.flatMap(({ label, at }, index) => {
    if (!at) return [];
    const [x, y, width] = at;
    const shift = (index % 3 - 1) * 2;
    const side = x + width / 2;
    return [{ from: label, to: oracle, y: y + 7 + shift, x: [side, rail] },
      { from: oracle, to: label, y: y - 9 + shift, x: [rail, side + 1] }];
  });
  const ofOutcomes = outcomes.flatMap(({ label, at }) => (
    at ? [{ from: oracle, to: label, y: at[1], x: [rail, at[0] + at[2] / 2 + 1] }] : []));
  return /** @type {OracleLine[]} */ ([...ofStates, ...ofOutcomes]);
}

/**
 * The rail.
 * @param {server.Graph} graph
 * @param {string} id
 * @param {boolean} active
 */
export function oracleShape(graph, id, active) {
  const { rail, height } = measured(graph);
  const labels = [];
  for (let y = Math.min(60, height / 2); y < height; y += RAIL_LABELS) {
    labels.push(svg('text', { x: rail + RAIL_WIDTH / 2, y, class: 'oracle-name' },
      shorten(graph.oracle, 80)));
  }
  return svg('g', { class: 'oracle' + (active ? ' active' : ''), id },
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
 * @param {machine.ShownRate | undefined} learned
 * @param {string[]} kinds active, failed, found
 */
export function stateShape(label, [x, y, width, height], id, open, learned, kinds) {
  const { rate = null, failures = 0, successes = 0 } = learned || {};
  const words = rate === null ? ''
    : `failed ${failures}/${failures + successes} · est. ${percent(rate)}`;
  const box = { width, height, rx: 10 };
  return svg('g', { class: ['state', open && 'nested', words && 'known', ...kinds].filter(Boolean)
    .join(' '), id, transform: translate(x, y), '--hue': rate === null ? null : hue(rate),
  onclick: open, onkeydown: open && ((event) => openByKey(event, open)),
  tabindex: open ? '0' : null, role: open ? 'button' : null },
  svg('title', {}, label + (words && ': ' + words)),
  open && svg('rect', { class: 'behind', x: -width / 2 + 4, y: -height / 2 + 5, ...box }),
  svg('rect', { class: 'box', x: -width / 2, y: -height / 2, ...box }),
  svg('text', { y: -3, class: 'state-name' }, shorten(label, width)),
  svg('text', { y: 15, class: 'state-rate' }, words),
  svg('g', { class: 'failed-mark', transform: translate(width / 2 - 2, -height / 2 + 2) },
    svg('circle', { r: 9 }), svg('text', { y: 4 }, '!')));
}
