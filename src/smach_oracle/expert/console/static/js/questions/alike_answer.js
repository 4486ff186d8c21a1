// @ts-check
// The same answer for several like questions. Each is checked, claimed and answered by itself:
// where the answer is not offered it is not sent, and that is said.
import { NoReply, unlessLost } from '../page/connection.js';
import { h } from '../page/dom.js';
import { breakable, counted, duration, percent } from '../page/format.js';
import { keep, render } from '../page/redraw.js';
import { robotMark } from '../robots/robot_mark.js';

/** @typedef {{ ok: boolean, words: string }} Check */
/** @typedef {{ answer: server.Answer, words: string, offered: number, advised: number }} Offer */

const PAUSE_MS = 250; // between two questions: two commands each, and ten a second are allowed
const BY_ITSELF = ' Answer it by itself.';

export class AlikeAnswer {
  /**
   * @param {page.App} app
   * @param {server.Question[]} questions
   * @param {() => void} leave
   */
  constructor(app, questions, leave) {
    this.app = app;
    this.questions = questions;
    this.key = ''; // it is no question
    this.held = this.settled = false;
    this.leave = leave;
    this.ended = false;
    /** @type {Set<string>} */
    this.unwanted = new Set(); // keys of questions that a person has left out
    /** @type {Map<string, Check>} */
    this.results = new Map(); // by key, of those that were sent
    this.sending = false;
    const [{ state, what }] = questions;
    this.offers = offersOf(questions);
    this.title = h('h2', { tabindex: -1 }, breakable(state, '_'), ' ', what, ': the same answer');
    this.choice = h('select', { id: 'alike-answer', onchange: () => this.show() },
      h('option', { value: '' }, 'Choose an answer'),
      this.offers.map(({ words, offered, advised }, index) => h('option', { value: index },
        words + ' (offered by ' + offered + (advised ? ', recommended by ' + advised : '') + ')')));
    this.why = h('input', { type: 'text', maxlength: 2000, placeholder: 'Reason (optional)',
      'aria-label': 'Reason, for the record' });
    this.said = ''; // to how many it was sent
    this.root = h('article', {});
    this.show();
  }

  /** @returns {server.Answer | undefined} */
  get answer() {
    const offer = this.choice.value && this.offers[Number(this.choice.value)];
    return offer ? { ...offer.answer, why: this.why.value } : undefined;
  }

  /** Those to which it would be sent now. */
  get ready() {
    const { answer } = this;
    return answer ? this.questions.filter(({ key }) => !this.unwanted.has(key)
      && !this.results.has(key) && this.check(key, answer).ok) : [];
  }

  /**
   * @param {string} key
   * @param {server.Answer} answer
   * @returns {Check}
   */
  check(key, answer) {
    const now = this.app.store.questions.find((each) => each.key === key);
    if (!now) return { ok: false, words: 'is open no longer' };
    const silent = this.app.liveness.whoIsSilent(now);
    if (silent) return { ok: false, words: 'nothing is heard from ' + silent };
    if (now.holder && !this.app.isMine(now)) {
      return { ok: false, words: now.holder + ' works on it' };
    }
    if (now.status === 'interface') return { ok: false, words: now.interface + ' runs for it' };
    return fits(answer, now, this.app.store.get('preconditions')?.[key] || {});
  }

  show() {
    this.choice.disabled = this.sending;
    render(this.root, this.view());
  }

  view() {
    const { answer, ready, questions, leave, sending } = this;
    const count = ready.length;
    return h('article', { class: 'detail alike' },
      h('header', { class: 'detail-head' }, h('button', { class: 'back',
        'aria-label': 'Back to the list', onclick: leave }, '‹'),
      h('div', {}, keep(this.title), h('p', { class: 'dim' },
        counted(questions.length, 'question'), ' · ', breakable(questions[0].path, '/')))),
      h('section', { class: 'card' }, h('label', { for: 'alike-answer' }, 'The answer'),
        keep(this.choice), keep(this.why),
        h('div', { class: 'alike-list' }, questions.map((each) => this.row(each, answer))),
        h('p', { class: 'dim', role: 'status' }, this.said),
        h('div', { class: 'row' }, h('button', { class: 'primary', 'data-action': 'send-alike',
          disabled: sending || !count || !this.app.mayAnswer,
          'data-deliberate': 'alike ' + count + ' ' + this.choice.value,
          onclick: () => this.sendAll() }, sending ? 'Sending…' : 'Send to ' + count),
        h('button', { 'data-action': 'leave-alike', onclick: leave }, 'Back to the list'))));
  }

  /**
   * @param {server.Question} question
   * @param {server.Answer | undefined} answer
   */
  row({ key, robot, asked }, answer) {
    const result = this.results.get(key);
    const found = result || (answer && this.check(key, answer));
    const mark = found && (found.ok ? '✓ ' : '✗ ');
    const box = h('input', { type: 'checkbox', disabled: Boolean(result) || this.sending,
      onchange: ({ target }) => {
        if (target instanceof HTMLInputElement && target.checked) this.unwanted.delete(key);
        else this.unwanted.add(key);
        this.show();
      } });
    box.checked = !this.unwanted.has(key);
    const kind = found ? (found.ok ? 'good' : 'bad') : '';
    return h('label', { key, class: 'alike-row', 'data-key': key }, box, robotMark(robot),
      h('b', {}, robot), h('span', { class: 'dim' },
        'waits ' + duration(this.app.store.now() - asked)),
      h('span', { class: 'check ' + kind }, found && mark + found.words));
  }

  /** One after the other. What this page has not held is let go where the answer is refused. */
  async sendAll() {
    const { answer, ready } = this;
    if (!answer || this.sending) return;
    this.sending = true;
    for (const { key } of ready) {
      if (this.ended) break;
      const check = this.check(key, answer); // it may have changed meanwhile
      this.results.set(key, check.ok ? await this.sendOne(key, answer) : check);
      this.show();
      await new Promise((done) => { setTimeout(done, PAUSE_MS); });
    }
    this.sending = false;
    const sent = ready.filter(({ key }) => this.results.get(key)?.ok).length;
    this.said = 'Sent to ' + sent + ' of ' + ready.length + '.';
    this.show();
  }

  /**
   * @param {string} question
   * @param {server.Answer} answer
   * @returns {Promise<Check>}
   */
  async sendOne(question, answer) {
    const { connection } = this.app;
    try {
      const claim = await connection.request('claim', { question });
      if (!claim.ok) return { ok: false, words: claim.message };
      const reply = await connection.request('answer', { question, ...answer });
      if (!reply.ok) connection.request('release', { question }).catch(() => {});
      return { ok: reply.ok, words: reply.ok ? 'sent' : reply.message };
    } catch (err) {
      unlessLost(err);
      return { ok: false, words: err instanceof NoReply ? 'not confirmed in time'
        : 'the connection was lost' };
    }
  }

  begin() { this.show(); }

  end() { this.ended = true; }

  pause() {}

  connected() {}

  shown() {}

  /** @param {string[]} [names] of sections that have changed; else it may be any */
  draw(names) {
    if (!names || names.includes('questions') || names.includes('preconditions')) this.show();
  }

  cancel() { return false; }

  press() {}
}

/**
 * The answers that some of the questions offer: states to go to, and outcomes where nothing is to
 * be entered. Interfaces and giving up are for one question at a time.
 * @param {server.Question[]} questions
 * @returns {Offer[]} those that are recommended first, then those that most of them offer
 */
function offersOf(questions) {
  /** @type {Map<string, Offer>} */
  const found = new Map();
  /**
   * @param {'goto' | 'supersede'} kind
   * @param {string} name
   * @param {string} container
   * @param {string} words
   * @param {boolean} advised
   */
  const count = (kind, name, container, words, advised) => {
    const id = JSON.stringify([kind, name, container]);
    const offer = found.get(id) || { words, offered: 0, advised: 0,
      answer: { kind, name, container, outputs: [], why: '' } };
    offer.offered += 1;
    offer.advised += Number(advised);
    found.set(id, offer);
  };
  for (const { choices, supersede, state, outputs } of questions) {
    for (const { state: name, container, recommended } of choices) {
      count('goto', name, container, 'Go to ' + (container && container + '/') + name,
        Boolean(recommended));
    }
    for (const { outcome } of outputs.length ? [] : supersede) {
      count('supersede', outcome, '', state + ' is done, with ' + outcome, false);
    }
  }
  return [...found.values()].sort((one, other) => (
    other.advised - one.advised || other.offered - one.offered));
}

/**
 * Whether a question offers an answer, and what is to be expected of it there.
 * @param {server.Answer} answer
 * @param {server.Question} question
 * @param {{ [state: string]: server.PreconditionStatus[] | undefined }} statuses
 * @returns {Check}
 */
export function fits({ kind, name, container }, question, statuses) {
  if (kind === 'supersede') {
    if (question.outputs.length) return { ok: false, words: 'has outputs to enter.' + BY_ITSELF };
    const there = question.supersede.some(({ outcome }) => outcome === name);
    return there ? { ok: true, words: 'offered' } : { ok: false, words: name + ' is not offered' };
  }
  const choice = question.choices.find((each) => each.state === name
    && each.container === container);
  if (kind !== 'goto' || !choice) return { ok: false, words: name + ' is not offered' };
  if (choice.blocked) return { ok: false, words: 'blocked: ' + choice.blocked };
  const unmet = container ? undefined : statuses[name]?.find(({ holds }) => holds === false);
  if (unmet) return { ok: false, words: unmet.name + ' does not hold.' + BY_ITSELF };
  const { missing, repeats, success, recommended } = choice;
  if (missing.length) {
    return { ok: false, words: 'userdata would be missing: ' + missing.join(', ') + '.'
      + BY_ITSELF };
  }
  if (repeats.length) {
    return { ok: false, words: 'would repeat ' + repeats.join(', ') + '.' + BY_ITSELF };
  }
  return { ok: true, words: recommended ? 'recommended: ' + recommended
    : 'offered' + (success === null ? '' : ', est. ' + percent(success) + ' ok') };
}
