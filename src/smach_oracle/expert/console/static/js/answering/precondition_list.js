// @ts-check
// The preconditions of a state, in the order in which they run, and whether each holds now.
import { h } from '../page/dom.js';
import { duration } from '../page/format.js';

/** @typedef {server.PreconditionStatus[] | undefined} Statuses in the order of the names */

const STALE_S = 8;
const HOLDS = { sign: '✓', word: 'holds', kind: 'good' };
const DOES_NOT_HOLD = { sign: '✗', word: 'does not hold', kind: 'bad' };
const UNKNOWN = { sign: '?', word: 'unknown', kind: '' };
const UNTOLD = { sign: '', word: '', kind: '' };

/** @param {server.PreconditionStatus | undefined} status */
function wordsOf(status) {
  if (!status) return UNTOLD;
  if (status.holds === null) return UNKNOWN;
  return status.holds ? HOLDS : DOES_NOT_HOLD;
}

/**
 * Without the name, which stands before it.
 * @param {server.PreconditionStatus | undefined} status
 */
function reasonOf(status) {
  if (!status || status.holds === true || !status.text) return '';
  const { name, text } = status;
  const rest = text.startsWith(name + ' ') ? text.slice(name.length + 1) : text;
  return ': ' + rest.replace('running ' + name + ' ', 'running it ');
}

/**
 * Since when the oldest of them is known, in words; '' where none is.
 * @param {Statuses} statuses
 * @param {number} now by the server's clock
 */
export function ageWords(statuses, now) {
  const age = now - oldest(statuses);
  return age < 1 ? 'as of now' : age < Infinity ? 'as of ' + duration(age) + ' ago' : '';
}

/** @param {Statuses} statuses */
function oldest(statuses) {
  const times = (statuses || []).flatMap(({ checked }) => checked ?? []);
  return times.length ? Math.min(...times) : -Infinity;
}

/**
 * A line each from the first: what is below stays where it is. Only their names where the robot
 * publishes nothing.
 * @param {string[]} names
 * @param {Statuses} statuses
 * @param {number} now by the server's clock
 */
export function preconditionList(names, statuses, now) {
  const stale = now - oldest(statuses) > STALE_S ? ' stale' : '';
  return h('span', { class: 'preconditions' }, 'preconditions',
    h('span', { class: 'dim age' }, ageWords(statuses, now)), names.map((name, index) => {
      const status = statuses?.[index];
      const { sign, word, kind } = wordsOf(status);
      return h('span', { class: 'precondition ' + kind + stale },
        h('span', { class: 'sign', 'aria-hidden': 'true' }, sign), h('span', {}, name), ' ',
        h('span', { class: 'word' }, word), h('span', { class: 'why' }, reasonOf(status)));
    }));
}
