// @ts-check
// What the robot does after an answer.
import { h, setText } from '../page/dom.js';
import { added } from '../page/format.js';
import { redraw } from '../page/redraw.js';

/** @typedef {import('../page/types').App} App */
/** @typedef {import('../server').Answer} Answer */
/** @typedef {import('../server').EventKind} EventKind */
/** @typedef {import('../server').EventSlice} EventSlice */
/** @typedef {import('../server').Question} Question */
/** @typedef {import('../server').TrialEvent} TrialEvent */

/** @type {Set<EventKind>} */
const SHOWN = new Set(['jump', 'supersede', 'give_up', 'interface_start', 'interface_end',
  'precondition_start', 'precondition_end', 'warning', 'state_start', 'transition', 'failure',
  'trial_end', 'query_opened', 'health_wait_start', 'health_wait_end']);
const MOST_SHOWN = 8;
const SILENCE_MS = 6000;
const AGAIN = 'It asks again; the question is in the list.';

export class FollowUp {
  /**
   * @param {App} app
   * @param {Question} question
   * @param {() => void} onLeave
   */
  constructor(app, question, onLeave) {
    this.app = app;
    this.question = question;
    /** @type {TrialEvent[]} */
    this.events = []; // of the question's trial
    this.since = 0; // ms, since the answer; 0 before
    this.silent = false; // it does nothing new: the state runs on
    this.steps = h('ol', { class: 'steps' });
    this.hint = h('p', { class: 'dim' });
    this.title = h('h3', { class: 'done' });
    this.root = h('div', { class: 'follow-up', role: 'status' }, this.title, this.steps, this.hint,
      h('div', { class: 'row' },
        h('button', { class: 'primary', onclick: onLeave }, 'Back to the list')));
    app.store.onEvents((slice) => this.take(slice));
  }

  /** @param {Pick<Answer, 'kind' | 'name'>} answer */
  begin(answer) {
    const { state, running } = this.question;
    const waits = running && answer.kind === 'goto' && answer.name === state;
    this.silent = waits;
    setText(this.title, '✓ The robot has your answer: '
      + (waits ? 'wait on' : answerWords(answer, state)));
    setText(this.hint, waits ? state + ' runs on. You are asked again if it takes twice as long.'
      : 'Waiting for what it does…');
    this.since = Date.now();
    this.watch();
  }

  watch() {
    this.events = [];
    this.app.connection.request('watch', { trial: this.question.trial }).catch(() => {});
  }

  /** @param {EventSlice} slice */
  take({ trial, from, events }) {
    if (!this.since || trial !== this.question.trial || from > this.events.length) return;
    this.events = this.events.slice(0, from).concat(events);
    const answered = this.events.findIndex(({ kind, query }) => (
      kind === 'query_answered' && query === this.question.id));
    if (answered < 0) return;
    const shown = this.events.slice(answered + 1).filter((event) => SHOWN.has(event.kind))
      .slice(0, MOST_SHOWN);
    redraw(this.steps, shown.map((event) => h('li', { class: event.kind },
      event.words || event.kind, h('span', { class: 'dim' }, added(event)))));
    if (this.silent && !shown.length) return;
    setText(this.hint, shown.some((event) => event.kind === 'query_opened') ? AGAIN : '');
  }

  update() {
    if (!this.since || this.silent || this.steps.childElementCount) return;
    if (Date.now() - this.since > SILENCE_MS) {
      setText(this.hint, 'What it does next is not known: nothing is heard on '
        + this.question.robot + '/oracle/events.');
    }
  }
}

/**
 * @param {Pick<Answer, 'kind' | 'name'>} answer
 * @param {string} state that failed
 */
function answerWords({ kind, name }, state) {
  if (kind === 'goto') return 'go to ' + name;
  if (kind === 'supersede') return state + ' counts as done, with ' + name;
  if (kind === 'give_up') return 'give up' + (name ? ' with ' + name : '');
  return 'interface ' + name;
}
