// @ts-check
// What the robot does after an answer: until its trial ends, or it asks again.
import { wasMeant } from '../page/deliberate.js';
import { h } from '../page/dom.js';
import { focusIsFree, moveFocus } from '../page/focus.js';
import { added } from '../page/format.js';
import { keep, render } from '../page/redraw.js';

/**
 * Where one may go from a question: to the list, or to another one, by its key and whether that was
 * meant.
 * @typedef {{ leave: () => void, choose: (key: string, meant: boolean) => void }} Ways
 */

/** @type {Set<server.EventName>} */
const SHOWN = new Set(['jump', 'supersede', 'give_up', 'interface_start', 'interface_end',
  'precondition_start', 'precondition_end', 'warning', 'state_start', 'transition', 'failure',
  'trial_end', 'query_opened', 'health_wait_start', 'health_wait_end', 'hold_start', 'hold_end',
  'sent', 'announce']);
const MOST_SHOWN = 12; // the latest
const SILENCE_MS = 6000;
const HELD = 'It waits until somebody lets it go on.';

export class FollowUp {
  /**
   * @param {page.App} app
   * @param {server.Question} question
   * @param {Ways} ways
   */
  constructor(app, question, ways) {
    this.app = app;
    this.question = question;
    this.ways = ways;
    /** @type {server.TrialEvent[]} */
    this.events = []; // of the question's trial
    /** @type {server.TrialEvent | null} */
    this.last = null; // with which it is over: the trial's end, or the next question
    this.since = 0; // ms, since the answer; 0 before
    /** @type {server.TrialEvent[]} */
    this.shown = [];
    /** @type {HTMLElement[]} */
    this.given = []; // what this has put the focus on: it may take it on from there
    this.waits = false; // it does nothing new: the state runs on
    this.title = h('h3', { class: 'done', tabindex: -1 });
    this.root = h('div', { class: 'follow-up', role: 'status' });
    this.stop = app.store.onEvents((slice) => this.take(slice));
  }

  /** @param {Pick<server.Answer, 'kind' | 'name' | 'container'>} answer */
  begin(answer) {
    const { state, running } = this.question;
    const gaveUp = answer.kind === 'give_up';
    this.waits = running && answer.kind === 'goto' && answer.name === state
      && !answer.container;
    this.title.className = gaveUp ? 'gave-up' : 'done';
    this.title.append((gaveUp ? '■ The robot gives up, as you said: '
      : '✓ The robot has your answer: ')
      + (this.waits ? 'wait on' : answerWords(answer, this.question)));
    this.since = Date.now();
    this.draw();
    this.watch();
  }

  watch() {
    this.events = [];
    this.app.connection.request('watch', { trial: this.question.trial }).catch(() => {});
  }

  /** @param {server.EventSlice} slice */
  take({ trial, from, events }) {
    if (!this.since || trial !== this.question.trial || from > this.events.length) return;
    this.events = this.events.slice(0, from).concat(events);
    const answered = this.events.findIndex(({ kind, query }) => (
      kind === 'query_answered' && query === this.question.id));
    if (answered < 0) return;
    const after = this.events.slice(answered + 1).filter((event) => SHOWN.has(event.kind));
    const end = after.findIndex((event) => this.ends(event));
    this.last = end < 0 ? null : after[end];
    this.shown = end < 0 ? after : after.slice(0, end + 1);
    this.draw();
  }

  /** @param {server.TrialEvent} event */
  ends({ kind }) { return kind === 'trial_end' || kind === 'query_opened'; }

  draw() {
    if (!this.since) return;
    const next = this.nextQuestion();
    const before = this.root.querySelector('.next-question');
    const free = focusIsFree(this.title, ...(before ? [before] : []), ...this.given);
    render(this.root, this.view(next));
    if (free && this.last && this.app.current === 'questions') this.focusNext();
  }

  /** @param {server.Question | undefined} next */
  view(next) {
    const { shown, last, ways } = this;
    const hidden = Math.max(0, shown.length - MOST_SHOWN);
    return h('div', { class: 'follow-up' + (last ? ' over' : ''), role: 'status' },
      keep(this.title), h('p', { class: 'dim', hidden: !hidden },
        hidden + ' earlier steps are left out.'),
      h('ol', { class: 'steps' }, shown.slice(hidden).map((event) => h('li',
        { class: event.kind }, event.words || event.kind,
        h('span', { class: 'dim' }, added(event))))),
      h('p', { class: 'hint-of-steps' }, this.hint),
      h('div', { class: 'row next-question', hidden: !next }, next && h('button', {
        class: 'primary', key: next.key, 'data-action': 'next-question',
        'data-deliberate': 'open ' + next.key,
        onclick: (/** @type {Event} */ event) => ways.choose(next.key, wasMeant(event)) },
      'Next question: ' + next.state + ' of ' + next.robot)),
      h('div', { class: 'row' }, h('button', { 'data-action': 'back', onclick: ways.leave },
        'Back to the list')));
  }

  get hint() {
    const { shown: steps } = this;
    const gone = this.last ? '' : this.app.liveness.gone(this.question);
    if (gone) return gone;
    if (!this.last && steps.length) {
      return steps[steps.length - 1].kind === 'hold_start' ? HELD : 'It goes on…';
    }
    if (!this.last) return this.hintBefore();
    if (this.last.kind === 'query_opened') return 'It asks again, about ' + this.last.state + '.';
    const { outcome } = this.last;
    return 'The trial is over' + (outcome ? ': it ended with ' + outcome + '.' : '.');
  }

  /** Before anything is heard of what it does. */
  hintBefore() {
    const { state, robot } = this.question;
    if (this.waits) return state + ' runs on. You are asked again if it takes twice as long.';
    return this.since && Date.now() - this.since > SILENCE_MS
      ? 'What it does next is not known: nothing is heard on ' + robot + '/oracle/events.'
      : 'Waiting for what it does…';
  }

  /** The question that it asks now; else the oldest that nobody works on. */
  nextQuestion() {
    const { last } = this;
    if (!last) return undefined;
    const { questions } = this.app.store;
    const again = questions.find(({ id, trial }) => (
      last.kind === 'query_opened' && id === last.query && trial === this.question.trial));
    return again || questions.find(({ status }) => status === 'pending');
  }

  /** What the robot did is over: the next thing to do is the next question, or to go back. */
  focusNext() {
    const wanted = this.root.querySelector('.next-question button, [data-action=back]');
    const shown = this.root.isConnected && !document.querySelector('dialog[open]');
    if (!(wanted instanceof HTMLElement) || !shown || document.activeElement === wanted) return;
    this.given = [wanted];
    moveFocus(wanted);
  }
}

/**
 * @param {Pick<server.Answer, 'kind' | 'name' | 'container'>} answer
 * @param {server.Question} question
 */
function answerWords({ kind, name, container }, { state, path }) {
  if (kind === 'goto') return 'go to ' + (container ? container + '/' : '') + name;
  if (kind === 'supersede') return state + ' counts as done, with ' + name;
  if (kind === 'give_up') {
    return (container || path) + ' ends '
      + (name ? 'with ' + name : 'as the failure would have ended it');
  }
  return 'interface ' + name;
}
