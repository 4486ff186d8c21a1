// @ts-check
// The preconditions of a state, in the order in which they run, and whether each holds now.
import { h, setText } from '../page/dom.js';
import { duration } from '../page/format.js';

/** @typedef {{ [part in 'root' | 'sign' | 'word' | 'why']: HTMLElement }} Item */

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

export class PreconditionList {
  /** @param {string[]} names */
  constructor(names) {
    this.items = names.map(itemOf);
    this.age = h('span', { class: 'dim age' });
    // a line each from the first: what is below stays where it is
    this.root = h('span', { class: 'preconditions' }, 'preconditions', this.age,
      this.items.map((item) => item.root));
  }

  /**
   * Only their names where the robot publishes nothing.
   * @param {server.PreconditionStatus[] | undefined} statuses in the same order
   * @param {number} now by the server's clock
   */
  show(statuses, now) {
    const checked = (statuses || []).map((status) => status.checked ?? Infinity);
    const oldest = Math.min(...checked);
    const age = now - oldest;
    const stale = age > STALE_S ? ' stale' : '';
    this.items.forEach((item, index) => showStatus(item, statuses && statuses[index], stale));
    const when = age < 1 ? 'as of now' : 'as of ' + duration(age) + ' ago';
    setText(this.age, oldest < Infinity ? when : '');
  }
}

/**
 * @param {string} name
 * @returns {Item}
 */
function itemOf(name) {
  const sign = h('span', { class: 'sign', 'aria-hidden': 'true' });
  const word = h('span', { class: 'word' });
  const why = h('span', { class: 'why' });
  const root = h('span', { class: 'precondition' }, sign, h('span', {}, name), ' ', word, why);
  return { root, sign, word, why };
}

/**
 * @param {Item} item
 * @param {server.PreconditionStatus | undefined} status
 * @param {string} stale a class
 */
function showStatus(item, status, stale) {
  const { sign, word, kind } = wordsOf(status);
  setText(item.sign, sign);
  setText(item.word, word);
  const shown = 'precondition ' + kind + stale;
  if (item.root.className !== shown) item.root.className = shown;
  setText(item.why, reasonOf(status));
}
