// @ts-check
// The cards of the queue, and the tools to sort, filter and search them.
import { waits } from '../page/alerts.js';
import { wasMeant } from '../page/deliberate.js';
import { h, pick } from '../page/dom.js';
import {
  FAILURE_CLASSES, breakable, chip, counted, percent, rateBar, since, until,
} from '../page/format.js';
import { remember, remembered } from '../page/preferences.js';
import { robotsOf } from '../robots/fleet_facts.js';
import { knowRobots, robotMark, signOf } from '../robots/robot_mark.js';
import { readersOf } from './onlookers.js';
import { FILTERS, ORDERS, advice, causeOf, grouped, wanted } from './queue_wishes.js';

/** @typedef {import('./queue_wishes.js').Filter} Filter */
/** @typedef {import('./queue_wishes.js').Group} Group */
/** @typedef {import('./queue_wishes.js').Order} Order */
/** @typedef {import('./queue_wishes.js').Wishes} Wishes */
/** @typedef {ReturnType<typeof factsOf>} Facts */

export const URGENT_S = 20;
const LONGEST_NAME = 14; // of a reader
const FEW = 3; // questions, which need no tools
const CONTINUOUS = 'It failed again without a success in between';

/** The tools above the list. */
export class QueueTools {
  /** @param {() => void} changed */
  constructor(changed) {
    const order = remembered('queue-order', 'oldest');
    this.order = pick({ 'aria-label': 'Order', title: 'Order' }, Object.entries(ORDERS), order,
      changed);
    this.filter = pick({ 'aria-label': 'Which ones', title: 'Which ones' },
      Object.entries(FILTERS), 'all', changed);
    this.search = h('input', { type: 'search', placeholder: 'Search', 'aria-label': 'Search',
      class: 'queue-search', oninput: changed });
    this.together = h('input', { type: 'checkbox', onchange: changed });
    this.together.checked = remembered('queue-together', 'yes') === 'yes';
    this.root = h('div', { class: 'queue-tools', role: 'search' }, this.search, this.order,
      this.filter, h('label', {}, this.together, ' Like ones together'));
  }

  /** @returns {Wishes} */
  get wishes() {
    return { order: /** @type {Order} */ (this.order.value), text: this.search.value,
      filter: /** @type {Filter} */ (this.filter.value), together: this.together.checked };
  }

  /**
   * The questions to show. Few are all shown, unless somebody has asked for less.
   * @param {page.App} app
   * @returns {Group[]}
   */
  groups(app) {
    const open = app.store.questions;
    const { wishes } = this;
    this.root.hidden = open.length <= FEW && wishes.filter === 'all' && !wishes.text;
    remember('queue-order', wishes.order);
    remember('queue-together', wishes.together ? 'yes' : 'no');
    const questions = wanted(open, wishes, { waits, isMine: (each) => app.isMine(each) });
    return grouped(questions, wishes.together);
  }

  clear() {
    this.search.value = '';
    this.filter.value = 'all';
  }
}

/**
 * @typedef {object} Ways
 * @property {(key: string) => boolean} isChosen
 * @property {(key: string, meant: boolean) => void} choose
 * @property {(alike: string) => void} answerAlike
 */

/**
 * The list: groups of like questions under their heads, flat, so that what stays is never moved.
 * @param {page.App} app
 * @param {import('../page/redraw.js').Cards} cards that there were, by question
 * @param {Group[]} groups
 * @param {Ways} ways
 * @returns {page.Child[]}
 */
export function queueList(app, cards, groups, ways) {
  const now = app.store.now();
  knowRobots(robotsOf(app));
  cards.only(groups.flatMap(({ questions }) => questions.map(({ key }) => key)));
  let before = false; // a group with a head
  return groups.flatMap(({ alike, questions }) => {
    const many = questions.length > 1;
    const head = many ? groupHead(app, alike, questions, ways)
      : before && h('p', { key: 'after ' + alike, class: 'group-end', 'aria-hidden': true });
    before = many;
    return [head, ...questions.map((question) => {
      const facts = factsOf(app, question, ways.isChosen(question.key), now);
      return cards.card(question.key, facts, () => card(facts, now, ways));
    })];
  });
}

/**
 * @param {page.App} app
 * @param {string} alike
 * @param {server.Question[]} questions
 * @param {Ways} ways
 */
function groupHead(app, alike, questions, { answerAlike }) {
  const [{ state, path, what }] = questions;
  return h('div', { key: 'head ' + alike, class: 'group-head', role: 'heading', 'aria-level': 2 },
    h('span', {}, h('strong', {}, counted(questions.length, 'question')), ' alike: ',
      breakable(path, '/'), '/', breakable(state, '_'), ' ', what),
    app.mayAnswer && h('button', { class: 'tool', 'data-action': 'alike',
      onclick: () => answerAlike(alike) }, 'The same answer for these'));
}

/**
 * What its card says of a question: few words, which are compared quickly. How long it has waited
 * grows without them.
 * @param {page.App} app
 * @param {server.Question} question
 * @param {boolean} chosen
 * @param {number} now by the server's clock
 */
function factsOf(app, question, chosen, now) {
  const { key, status, state, robot, path, what, text, holder, asked, deadline, rate, continuous,
    class: rank, interface: name } = question;
  return { key, status, state, robot, path, what, holder, asked, deadline, rate, continuous, rank,
    name, chosen, sign: signOf(robot), cause: causeOf(text), advised: adviceOf(question),
    mine: app.isMine(question), waiting: waits(question), readers: readersOf(app, key),
    silent: Boolean(app.liveness.whoIsSilent(question)),
    urgent: deadline !== null && deadline - now < URGENT_S };
}

/**
 * @param {Facts} facts
 * @param {number} now by the server's clock
 * @param {Ways} ways
 */
function card(facts, now, { choose }) {
  const { key, status, state, robot, path, what, cause, silent, chosen } = facts;
  return h('button', { class: 'question-row ' + status + (silent ? ' silent' : ''),
    'data-key': key, 'data-deliberate': 'open ' + key, 'aria-current': chosen,
    onclick: (/** @type {Event} */ event) => choose(key, wasMeant(event)) },
  h('span', { class: 'row' }, robotMark(robot), h('span', { class: 'where' }, h('b', {}, robot),
    h('span', { class: 'dim' }, ' · ', breakable(path, '/'))),
  h('span', { class: 'spacer' }), statusChip(facts)),
  h('span', { class: 'sentence' }, h('strong', {}, breakable(state, '_')), ' ', what),
  cause && h('span', { class: 'cause', title: cause }, cause),
  adviceLine(facts), severity(facts), times(facts, now));
}

/** @param {server.Question} question */
function adviceOf(question) {
  const found = advice(question);
  if (!found) return null;
  const { choice: { state, container, helped: [helped, tried] }, why } = found;
  return { state, container, why, words: why ? 'recommended: ' + why
    : 'led on ' + helped + ' of ' + tried + ' before' };
}

/** @param {Facts} facts */
function adviceLine({ advised }) {
  return advised && h('span', { class: 'advice', title: advised.why },
    h('strong', {}, '→ ', advised.container && advised.container + '/',
      breakable(advised.state, '_')), ' ', advised.words);
}

/** @param {Facts} facts */
function severity({ rank, continuous, rate }) {
  const words = FAILURE_CLASSES[rank];
  return h('span', { class: 'chips' },
    words && chip(words + ' failure rate', 'class-' + rank),
    continuous && chip('again and again', 'warn', CONTINUOUS),
    h('span', { class: 'spacer' }),
    h('span', { title: 'How often it is expected to fail, as learned' },
      rateBar(rate, undefined, 'est. ' + percent(rate) + ' fail')));
}

/**
 * @param {Facts} facts
 * @param {number} now by the server's clock
 */
function times({ asked, deadline, status, urgent }, now) {
  const pending = status === 'pending';
  return h('span', { class: 'row times' },
    h('span', { class: 'dim' }, pending ? 'waits ' : 'asked ', since(asked, now),
      !pending && ' ago'),
    h('span', { class: 'spacer' }),
    deadline === null ? h('span', { class: 'dim' }, 'no time limit')
      : h('span', { class: 'left' + (urgent ? ' urgent' : '') }, until(deadline, now), ' left'));
}

/** @param {Facts} facts */
function statusChip({ status, holder, name, mine, waiting, readers }) {
  if (status === 'interface') {
    return chip(name + ' runs', 'accent', 'The interface that somebody started for it');
  }
  if (waiting && holder) {
    return chip((mine ? 'yours' : holder) + ' · idle', 'bad',
      'Whoever holds it has pressed nothing for a while');
  }
  if (!holder) return chip(readWords(readers), 'bad');
  return mine ? chip('yours', 'good') : chip(holder, 'warn');
}

/**
 * What is said of a question that nobody works on.
 * @param {string[]} readers others who look at it
 */
function readWords(readers) {
  if (!readers.length) return 'waiting';
  const who = readers.length === 1 ? shortened(readers[0]) + ' reads' : readers.length + ' read';
  return 'waiting · ' + who;
}

/** @param {string} name */
function shortened(name) {
  return name.length > LONGEST_NAME ? name.slice(0, LONGEST_NAME - 1) + '…' : name;
}
