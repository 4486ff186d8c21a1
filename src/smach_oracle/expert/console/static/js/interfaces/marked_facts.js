// @ts-check
// What a perception interface has made out, in numbers.
import { h } from '../page/dom.js';

/**
 * @param {server.MarkedObject} object
 * @param {number} elapsed s
 */
export function markedFacts({ size, position, yaw, frame, points }, elapsed) {
  const lengths = size.map((value) => (100 * value).toFixed(1)).join(' × ');
  const place = position.map((value, axis) => 'xyz'[axis] + ' ' + value.toFixed(3)).join('  ');
  return h('dl', {}, factRows([['Size', lengths + ' cm'], ['Centre', place + ' m'],
    ['Turned', Math.round(yaw * 180 / Math.PI) + '°'], ['In frame', frame],
    ['Points', String(points)], ['Cut out in', Math.round(1000 * elapsed) + ' ms']]));
}

/** @param {[name: string, value: string][]} facts */
export function factRows(facts) {
  return facts.map(([name, value]) => [h('dt', {}, name),
    h('dd', { class: 'number', 'data-fact': name.toLowerCase() }, value)]);
}
