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
  return h('dl', {}, fact('Size', lengths + ' cm'), fact('Centre', place + ' m'),
    fact('Turned', Math.round(yaw * 180 / Math.PI) + '°'), fact('In frame', frame),
    fact('Points', points), fact('Cut out in', Math.round(1000 * elapsed) + ' ms'));
}

/**
 * @param {string} name
 * @param {string | number} value
 */
function fact(name, value) {
  return [h('dt', {}, name),
    h('dd', { class: 'number', 'data-fact': name.toLowerCase() }, value)];
}
