// @ts-check
// The preconditions of a state, in the order in which they run, and whether each holds now.
import { h, setText } from '../page/dom.js';
import { duration } from '../page/format.js';

/** @typedef {import('../server').PreconditionCheck} PreconditionCheck */
/** @typedef {{ [part in 'root' | 'sign' | 'word' | 'why']: HTMLElement }} Item */

const STALE_S = 8;
const HOLDS = { sign: '✓', word: 'holds', kind: 'good' };
const DOES_NOT_HOLD = { sign: '✗', word: 'does not hold', kind: 'bad' };
const UNKNOWN = { sign: '?', word: 'unknown', kind: '' };
const UNTOLD = { sign: '', word: '', kind: '' };

/** @param {PreconditionCheck | undefined} check */
function wordsOf(check) {
  if (!check) return UNTOLD;
  if (check.holds === null) return UNKNOWN;
  return check.holds ? HOLDS : DOES_NOT_HOLD;
}

/**
 * Without the name, which stands before it.
 * @param {PreconditionCheck | undefined} check
 */
function reasonOf(check) {
  if (!check || check.holds === true || !check.text) return '';
  const { name, text } = check;
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
   * @param {PreconditionCheck[] | undefined} checks in the same order
   * @param {number} now by the server's clock
   */
  show(checks, now) {
    const looked = (checks || []).map((check) => check.looked ?? Infinity);
    const oldest = Math.min(...looked);
    const age = now - oldest;
    const stale = age > STALE_S ? ' stale' : '';
    this.items.forEach((item, index) => showCheck(item, checks && checks[index], stale));
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
 * @param {PreconditionCheck | undefined} check
 * @param {string} stale a class
 */
function showCheck(item, check, stale) {
  const { sign, word, kind } = wordsOf(check);
  setText(item.sign, sign);
  setText(item.word, word);
  const shown = 'precondition ' + kind + stale;
  if (item.root.className !== shown) item.root.className = shown;
  setText(item.why, reasonOf(check));
}
