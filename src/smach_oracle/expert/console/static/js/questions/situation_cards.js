// @ts-check
// What a question says of the situation: the failure, the way there, and the userdata.
import { h } from '../page/dom.js';
import { FAILURE_CLASSES, breakable, chip, rateBar } from '../page/format.js';

/** @type {{ [result in server.Visit['result']]: { sign: string, kind: string } }} */
const RESULTS = { success: { sign: '✓', kind: 'good' }, failure: { sign: '✗', kind: 'bad' },
  superseded: { sign: '☞', kind: 'accent' }, preempted: { sign: '■', kind: 'warn' },
  '': { sign: '?', kind: '' } };
const MOST_VISITS = 24;
/** What is missing before the visits that are shown. */
const MISSING = { unheard: 'not known: this console has not heard all that came before',
  older: '… earlier ones' };
const LONG = 160; // characters of a value
const BEGINNING = 80;
const CONTINUOUS = 'It failed again without a success in between';

/** @param {server.Question} question */
export function failureCard(question) {
  const { state, what, text } = question;
  return h('section', { class: 'card failure' },
    h('p', { class: 'what' }, state, ' ', what, '.'),
    text && h('pre', { class: 'text', tabindex: 0 }, text),
    h('dl', {}, failureFacts(question)));
}

/**
 * @param {server.Question} question
 * @returns {page.Child}
 */
function failureFacts(question) {
  const { rate, class: rank, continuous, reason, recoveries, tried, deadline, fallback } = question;
  return [
    fact('Failure rate', h('span', { class: 'chips' }, rateBar(rate),
      chip(FAILURE_CLASSES[rank] || '?', 'class-' + rank),
      continuous && chip('continuous', 'warn', CONTINUOUS))),
    fact('Asked because', reason),
    fact('Recoveries spent', recoveries),
    tried.length > 0 && fact('Tried so far',
      h('ol', { class: 'tried' }, tried.map((step) => h('li', {}, step)))),
    deadline !== null && fact('If nobody answers', fallback || 'the fallback happens'),
  ];
}

/**
 * @param {string} name
 * @param {page.Child} value
 * @returns {page.Child}
 */
function fact(name, value) {
  return [h('dt', {}, name), h('dd', {}, value)];
}

/** @param {server.Question} question */
export function visitsCard({ path, state, history, above }) {
  const cut = history.length > MOST_VISITS ? 'older' : '';
  /** @type {server.LevelVisits} */
  const own = { path, state, visits: history.slice(-MOST_VISITS), missing: cut };
  return (history.length > 0 || above.length > 0) && h('section', { class: 'card way' },
    h('h3', {}, 'How it came here'),
    h('div', { class: 'levels' }, above.map((level) => levelOf(level, true)),
      levelOf(own, false)));
}

/**
 * The visits of one container.
 * @param {server.LevelVisits} level
 * @param {boolean} runs whether its state is one that the way goes on in
 */
function levelOf({ path, state, visits, missing }, runs) {
  return h('div', { class: 'level' }, h('p', { class: 'dim' }, breakable(path, '/')),
    h('ol', { class: 'visits', 'aria-label': 'Visited in ' + path },
      missing && h('li', { class: 'missing' }, MISSING[missing]),
      visits.map(visitItem),
      runs ? h('li', { class: 'here' }, state, ' ', h('span', { class: 'sign' }, '▾'),
        h('span', { class: 'dim' }, ' in it'))
        : !visits.length && h('li', { class: 'missing' }, 'nothing before')));
}

/** @param {server.Visit} visit */
function visitItem({ state, outcome, result }) {
  const { sign, kind } = RESULTS[result];
  return h('li', { class: kind, title: outcome }, state, ' ', h('span', { class: 'sign' }, sign),
    result === 'failure' && outcome && h('span', { class: 'dim' }, ' ' + outcome));
}

/** @param {server.Question} question */
export function userdataCard({ userdata }) {
  return userdata.length > 0 && h('section', { class: 'card' }, h('h3', {}, 'Userdata'),
    h('table', { class: 'userdata' }, h('tbody', {}, userdata.map((item) => (
      h('tr', {}, h('th', { scope: 'row' }, item.key), h('td', {}, valueOf(item))))))));
}

/**
 * @param {server.UserdataItem} item
 * @returns {page.Child}
 */
function valueOf({ type, value, note }) {
  const notes = note && h('span', { class: 'dim' }, ' ' + note);
  if (value.length > LONG) {
    return [h('details', {}, h('summary', {}, type || value.slice(0, BEGINNING) + '…'),
      h('pre', { tabindex: 0 }, value)), notes];
  }
  return [value && h('code', {}, value), ' ', type && h('span', { class: 'dim' }, type), notes];
}
