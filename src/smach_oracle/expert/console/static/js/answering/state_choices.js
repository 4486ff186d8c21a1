// @ts-check
// The states that a machine may be told to go to: which come first, and what is said of each.
import { h } from '../page/dom.js';
import {
  FAILURE_CLASSES, breakable, chip, counted, duration, percent, rateBar,
} from '../page/format.js';

/** @typedef {Pick<server.Question, 'state' | 'running' | 'history'>} Asked */

const LIKELIEST = 6;
const MOST_HELPFUL = 2;

/**
 * The likeliest of very many states: the recommended one, those that helped before, the failed one,
 * the one that follows its success, and those that succeeded last.
 * @param {server.Question} question
 */
export function likeliest({ choices, state, supersede, history }) {
  /** @param {server.StateChoice} choice */
  const share = ({ helped: [helped, tried] }) => helped / tried;
  const helpful = choices.filter((choice) => choice.helped[0] > 0)
    .sort((one, other) => share(other) - share(one)).slice(0, MOST_HELPFUL);
  const came = history.filter((visit) => visit.result === 'success').reverse();
  const recommended = choices.filter((choice) => choice.recommended);
  const names = [...recommended, ...helpful].map((choice) => choice.state).concat(
    state,
    supersede.map((choice) => choice.target),
    came.map((visit) => visit.state),
  );
  const known = names.filter((name) => choices.some((choice) => choice.state === name));
  const first = [...new Set(known)].slice(0, LIKELIEST);
  return choices.filter((choice) => first.includes(choice.state));
}

/**
 * What a button says of a state.
 * @param {server.StateChoice} choice
 * @param {Asked} question
 * @returns {page.Child[]}
 */
export function stateLines(choice, question) {
  const { state: failed, running } = question;
  const same = choice.state === failed && !choice.container;
  return [
    choice.container && h('span', { class: 'dim' }, breakable(choice.container, '/'), ' /'),
    h('span', { class: 'row' },
      h('strong', { class: 'ellipsis' }, same && running && 'Wait on: ',
        breakable(choice.state, '_')),
      same && (running ? chip('runs on', '', 'You are asked again if it takes twice as long')
        : chip('again: it has just failed', 'warn')),
      h('span', { class: 'spacer' }), successBar(choice)),
    h('span', { class: 'chips' }, stateChips(choice, question)),
  ];
}

/**
 * What is to be expected of going there: how often that led on, else how often the state succeeds.
 * @param {server.StateChoice} choice
 */
function successBar({ success, helped: [helped, tried] }) {
  if (tried > 0) {
    return rateBar(1 - helped / tried, helped / tried, 'led on ' + helped + ' of ' + tried);
  }
  return success === null ? rateBar(null)
    : rateBar(1 - success, success, 'est. ' + percent(success) + ' ok');
}

/**
 * Where the count of the bar is from, or how long going there took.
 * @param {server.StateChoice} choice
 * @param {string} failed the state that failed
 */
function helpedChip({ helped: [helped, tried], helped_s: seconds }, failed) {
  if (tried > 0 && seconds === null) {
    return chip('as this console saw', '', 'How often going there led on from ' + failed);
  }
  return helped > 0 && seconds !== null && seconds >= 1
    && chip('then after ' + duration(seconds), '', 'Mean time until ' + failed + ' succeeded');
}

/**
 * The precondition of a state that has just failed: what the question is about, or what the last
 * visit to it ended in. '' where none has.
 * @param {server.StateChoice} choice
 * @param {Asked} question
 */
export function justFailed({ preconditions }, { state, running, history }) {
  return preconditions.find((name) => {
    const last = history.filter((visit) => visit.state === name).pop();
    return (name === state && !running) || last?.result === 'failure';
  }) || '';
}

/**
 * @param {server.StateChoice} choice
 * @param {Asked} question
 * @returns {page.Child[]}
 */
function stateChips(choice, question) {
  const { class: rank, blocked, repeats, missing, visits, recommended } = choice;
  const again = choice.runs_again;
  const words = FAILURE_CLASSES[rank];
  const unmet = justFailed(choice, question);
  return [
    recommended && chip('recommended', 'good', recommended),
    words && chip(words + ' failure rate', 'class-' + rank),
    blocked && chip('blocked: ' + blocked, 'bad'),
    repeats.length > 0 && chip('repeats: ' + repeats.join(', '), 'warn',
      'Done in this trial, and not repeated by itself'),
    again.length > 0 && chip('runs again: ' + again.join(', '), 'warn',
      'All branches of a Concurrence run again'),
    unmet && chip(unmet + ' has just failed', 'bad', 'A precondition of it'),
    missing.length > 0 && chip('missing: ' + missing.join(', '), 'warn',
      'Userdata that it needs and would not have'),
    visits > 0 && chip(counted(visits, 'visit'), '', 'In this trial'),
    helpedChip(choice, question.state),
  ];
}
