// @ts-check
// Which of the open questions a person wants to see, and in which order. Pure.
import { FAILURE_CLASSES } from '../page/format.js';

/** @typedef {'oldest' | 'deadline' | 'severity' | 'robot'} Order */
/** @typedef {'all' | 'waiting' | 'mine'} Filter */
/**
 * @typedef {object} Wishes
 * @property {Order} order
 * @property {Filter} filter
 * @property {string} text what a card must have
 * @property {boolean} together whether like questions stand together
 */
/** @typedef {{ alike: string, questions: server.Question[] }} Group */
/** @typedef {(question: server.Question) => boolean} IsSuch */

/** @type {{ [order in Order]: string }} */
export const ORDERS = { oldest: 'Oldest first', deadline: 'Least time first',
  severity: 'Worst first', robot: 'By robot' };
/** @type {{ [filter in Filter]: string }} */
export const FILTERS = { all: 'All', waiting: 'Nobody works on', mine: 'Mine' };

/** @type {{ [order in Order]: (question: server.Question) => number | string }} */
const FIRST = {
  oldest: ({ asked }) => asked,
  deadline: ({ deadline }) => deadline ?? Infinity,
  severity: ({ class: rank, continuous, rate }) => (
    -(4 * rank + (continuous ? 2 : 0) + (rate || 0))),
  robot: ({ robot }) => robot,
};

/**
 * The questions that are wanted, in their order. Of equal ones the oldest is first.
 * @param {server.Question[]} open oldest first
 * @param {Wishes} wishes
 * @param {{ waits: IsSuch, isMine: IsSuch }} is
 */
export function wanted(open, { order, filter, text }, { waits, isMine }) {
  const words = text.toLowerCase().split(/\s+/).filter(Boolean);
  const first = FIRST[order];
  return open.filter((question) => filter === 'all'
    || (filter === 'mine' ? isMine(question) : waits(question)))
    .filter((question) => words.every((word) => textOf(question).includes(word)))
    .sort((one, other) => compare(first(one), first(other)));
}

/**
 * @param {number | string} one
 * @param {number | string} other
 */
function compare(one, other) {
  if (typeof one === 'string') {
    return one.localeCompare(String(other), undefined, { numeric: true });
  }
  return one === other ? 0 : one - Number(other); // Infinity less itself is no number
}

/**
 * All that is said of a question on its card, to be searched.
 * @param {server.Question} question
 */
function textOf({ robot, path, state, what, text, holder, class: rank }) {
  return [robot, path + '/' + state, what, text, holder, FAILURE_CLASSES[rank]].join(' ')
    .toLowerCase();
}

/**
 * Like questions together, each group where its first one stands. Like are those about the same
 * state that has failed in the same way.
 * @param {server.Question[]} questions
 * @param {boolean} together else each is a group of its own
 * @returns {Group[]}
 */
export function grouped(questions, together) {
  /** @type {Map<string, Group>} */
  const groups = new Map();
  for (const question of questions) {
    const { key, path, state, what, outcome } = question;
    const alike = together ? JSON.stringify([path, state, what, outcome]) : key;
    const group = groups.get(alike) || { alike, questions: [] };
    group.questions.push(question);
    groups.set(alike, group);
  }
  return [...groups.values()];
}

/**
 * What to do about a question: what its robot recommends, else what led on most often before.
 * @param {server.Question} question
 */
export function advice({ choices }) {
  const choice = choices.find(({ recommended }) => recommended);
  if (choice) return { choice, why: choice.recommended };
  const [best] = choices.filter(({ helped: [helped] }) => helped > 0).sort((one, other) => (
    other.helped[0] / other.helped[1] - one.helped[0] / one.helped[1]
    || other.helped[1] - one.helped[1]));
  return best && { choice: best, why: '' };
}

/**
 * The line of a failure's text that says what happened: the last one, of a traceback.
 * @param {string} text
 */
export function causeOf(text) { return text.trim().split('\n').pop() || ''; }
