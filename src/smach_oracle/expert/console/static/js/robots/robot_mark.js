// @ts-check
// The mark of a robot, beside its name: a colour and a sign, so that many are told apart at a
// glance.
import { h } from '../page/dom.js';

const GOLDEN = 137.5; // degrees: neighbours on a list are far apart on the circle of colours
/** @type {Map<string, number>} */
const places = new Map(); // of each robot that this page knows
/** @type {Map<string, number>} */
const sharing = new Map(); // how many robots have a part of a name in its place from the end

/**
 * Know robots. Those that come together have their colours by the order of their names, whichever
 * asks first: so they keep them when the page begins again.
 * @param {string[]} names
 */
export function knowRobots(names) {
  for (const name of names.filter((each) => !places.has(each)).sort()) {
    places.set(name, places.size);
    for (const part of partsOf(name)) sharing.set(part, (sharing.get(part) || 0) + 1);
  }
}

/**
 * Its number, or the first letters of its name: of the last part that no other robot has there.
 * @param {string} name such as /fleet/robot_7 or /robot_7/task
 */
export function signOf(name) {
  const parts = partsOf(name);
  const [own] = (parts.find((part) => sharing.get(part) === 1) || parts[0]).split(' ');
  return /\d{1,3}$/.exec(own)?.[0] || own.replace(/[^\p{L}\p{N}]/gu, '').slice(0, 2) || '?';
}

/**
 * The parts of a name, the last one first, each with its place.
 * @param {string} name
 */
function partsOf(name) { return name.split('/').reverse().map((part, at) => part + ' ' + at); }

/** @param {string} name */
export function robotMark(name) {
  knowRobots([name]);
  const hue = Math.round((places.get(name) || 0) * GOLDEN + 250) % 360;
  return h('span', { class: 'robot-mark', 'aria-hidden': true, '--hue': hue }, signOf(name));
}
