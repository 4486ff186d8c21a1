// @ts-check
// The queue of all robots' open questions, and the one that is worked on.
import { waits } from '../page/alerts.js';
import { SETTLING_MS, wasMeant } from '../page/deliberate.js';
import { NO_EMERGENCY_STOP } from '../page/emergency.js';
import { h, modified, replace, setText, typing } from '../page/dom.js';
import { moveFocus } from '../page/focus.js';
import { breakable, chip, counted, duration, percent, rateBar } from '../page/format.js';
import { redraw } from '../page/redraw.js';
import { SettledKey } from '../page/settled_keys.js';
import { keysOn, turnedOff } from '../page/shortcuts.js';
import { Unreached } from './calls.js';
import { readersOf } from './onlookers.js';
import { tellPresses } from './presence.js';
import { QuestionDetail, URGENT_S } from './question_detail.js';

/** @typedef {import('../page/types').App} App */
/** @typedef {import('../page/types').Panel} Panel */
/** @typedef {import('../server').Question} Question */

/** @type {Panel} */
export const questions = { id: 'questions', title: 'Questions',
  create: (app) => new QuestionPanel(app) };

const NO_SERVER = 'No robot with an expert query server is known yet.';
const LONGEST_NAME = 14; // of a reader, in the list
const GONE = 'The question of this address is not open: it was answered or taken back, or its time '
  + 'was over.';
const QUIET = 'Robots recover by themselves where they can; they ask here where they cannot.';

class QuestionPanel {
  /** @param {App} app */
  constructor(app) {
    this.app = app;
    /** @type {QuestionDetail | null} */
    this.detail = null;
    /** @type {QuestionDetail | null} */
    this.aside = null; // still held: what took its place may have been opened by accident
    this.asideTimer = 0;
    /** @type {string | null} */
    this.wanted = null; // what an address names, until it is known whether it is open; '': the list
    this.missing = ''; // the question of an address, where it is not open
    this.queue = h('div', { class: 'queue', 'aria-label': 'Open questions' });
    this.stage = h('div', { class: 'stage' });
    this.unreached = new Unreached(app);
    this.servers = h('p', { class: 'dim servers' });
    this.ages = h('p', { class: 'dim servers ages-below' }); // where the top bar is too narrow
    this.root = h('div', { class: 'panel questions' },
      h('aside', { class: 'queue-side' }, this.queue, this.unreached.root, this.servers, this.ages,
        h('p', { class: 'dim servers no-emergency-stop' }, NO_EMERGENCY_STOP)), this.stage);
    this.nextKey = new SettledKey(() => this.next?.key || '');
    window.addEventListener('keydown', (event) => this.key(event));
    tellPresses(app, () => (this.detail?.held ? this.detail.key : ''));
    this.showStage();
  }

  get open() { return this.app.store.questions; }

  /** What `n` would open: the oldest question that nobody works on. */
  get next() {
    if (!this.takesKeys || !keysOn()) return undefined;
    return this.open.find(({ status, key }) => status === 'pending' && !this.isChosen(key));
  }

  get takesKeys() {
    return this.app.current === 'questions' && !document.querySelector('dialog[open]');
  }

  badge() { return this.open.filter(waits).length; }

  shown() {
    this.update(['questions', 'servers']);
    if (this.detail) this.detail.shown();
  }

  connected() { if (this.detail) this.detail.connected(); }

  tick() {
    this.showQueue();
    setText(this.ages, 'Heard: ' + this.app.liveness.ages() + ' ago');
    if (this.detail) this.detail.tick();
  }

  get place() { return this.detail?.key || ''; }

  /** @param {string} key of a question, '' for the list */
  goTo(key) {
    this.wanted = key;
    this.arrive();
  }

  /** Turn to what was wanted, once all that are open are known. */
  arrive() {
    const key = this.wanted;
    if (key === null || !this.app.store.get('questions')) return;
    this.wanted = null;
    if (!key) {
      if (this.detail) this.leave();
    } else if (this.open.some((each) => each.key === key)) {
      this.choose(key, false);
    } else if (!this.isChosen(key)) {
      this.close();
      this.missing = key;
      this.showStage();
    }
  }

  /** @param {string[]} names */
  update(names) {
    // a console that has just begun may not have heard of it yet
    const comes = this.open.some(({ key }) => key === this.missing);
    if (comes && !this.detail && this.app.current === 'questions') this.wanted = this.missing;
    if (names.includes('questions')) this.arrive();
    if (names.includes('servers')) this.showServers();
    if (names.includes('reach')) this.unreached.show();
    if (names.includes('questions') || names.includes('onlookers')) this.showQueue();
    if (this.detail) this.detail.update(names);
    else if (names.includes('questions')) this.showStage();
  }

  showServers() {
    const servers = (this.app.store.get('servers') || [])
      .map(({ name, connected }) => name + (connected ? '' : ' (gone)'));
    setText(this.servers, servers.length ? 'Listening to ' + servers.join(', ') : NO_SERVER);
  }

  showQueue() {
    const { open } = this;
    redraw(this.queue, open.length ? open.map((question) => this.row(question))
      : h('p', { class: 'empty' }, 'No open questions.'));
  }

  /** @param {string} key */
  isChosen(key) { return Boolean(this.detail && this.detail.key === key); }

  /** @param {Question} question */
  row(question) {
    const { key, status, state, robot, path, rate } = question;
    const silent = this.app.liveness.whoIsSilent(question) ? ' silent' : '';
    return h('button', { key, class: 'question-row ' + status + silent, 'data-key': key,
      'data-deliberate': 'open ' + key, 'aria-current': this.isChosen(key),
      onclick: (/** @type {Event} */ event) => this.choose(key, wasMeant(event)) },
    h('span', { class: 'row' }, h('strong', { class: 'ellipsis' }, breakable(state, '_')),
      h('span', { class: 'spacer' }), this.statusChip(question)),
    h('span', { class: 'row dim' }, h('span', { class: 'where' }, robot + ' · ' + path),
      h('span', { class: 'spacer' }),
      h('span', { title: 'How often it is expected to fail, as learned' },
        rateBar(rate, undefined, 'est. ' + percent(rate) + ' fail'))),
    this.times(question));
  }

  /** @param {Question} question */
  statusChip(question) {
    const { key, status, holder, interface: name } = question;
    if (status === 'interface') {
      return chip(name + ' runs', 'accent', 'The interface that somebody started for it');
    }
    if (waits(question) && holder) {
      return chip((this.app.isMine(question) ? 'yours' : holder) + ' · idle', 'bad',
        'Whoever holds it has pressed nothing for a while');
    }
    if (!holder) return chip(readWords(readersOf(this.app, key)), 'bad');
    return this.app.isMine(question) ? chip('yours', 'good') : chip(holder, 'warn');
  }

  /** @param {Question} question */
  times({ asked, deadline }) {
    const now = this.app.store.now();
    const left = deadline === null ? Infinity : deadline - now;
    return h('span', { class: 'row' },
      h('span', { class: 'dim' }, 'asked ' + duration(now - asked) + ' ago'),
      h('span', { class: 'spacer' }),
      left < Infinity && h('span', { class: 'left' + (left < URGENT_S ? ' urgent' : '') },
        duration(left) + ' left'));
  }

  /**
   * Open a question.
   * @param {string} key
   * @param {boolean} meant else the one that was held is let go once this one has been seen
   */
  choose(key, meant) {
    const question = this.open.find((each) => each.key === key);
    if (!question || (this.isChosen(key) && !this.detail?.settled)) return; // else it is put again
    const back = this.aside?.key === key ? this.aside : null;
    if (back) this.aside = null;
    this.missing = '';
    if (!meant && this.detail?.held && !this.detail.settled) this.putAside(this.detail);
    else this.close();
    this.detail = back || new QuestionDetail(this.app, question,
      { leave: () => this.leave(), choose: (...next) => this.choose(...next) });
    this.showStage();
    this.showQueue();
    moveFocus(this.detail.title);
    this.detail.begin();
    if (back) back.update(['questions', 'images']); // what it has missed
    this.app.went();
  }

  /**
   * Let it go once the other one has been seen. Until then the person can go back to it.
   * @param {QuestionDetail} detail
   */
  putAside(detail) {
    this.endAside();
    detail.pause();
    this.aside = detail;
    this.asideTimer = setTimeout(() => this.endAside(), SETTLING_MS);
  }

  endAside() {
    clearTimeout(this.asideTimer);
    if (this.aside) this.aside.end();
    this.aside = null;
  }

  /** Back to the list, as a person wants it: the focus goes to its first question. */
  leave() {
    this.close();
    this.missing = '';
    this.showStage();
    this.app.went();
    const first = this.queue.querySelector('.question-row') || this.stage.querySelector('h2');
    if (first instanceof HTMLElement) moveFocus(first);
  }

  close() {
    if (!this.detail) return;
    this.detail.end();
    this.detail = null;
    this.showStage();
    this.showQueue();
  }

  showStage() {
    this.root.classList.toggle('working', Boolean(this.detail));
    if (this.detail) {
      replace(this.stage, this.detail.root);
      this.stage.scrollTop = 0;
      return;
    }
    const waiting = this.badge();
    const title = waiting ? counted(waiting, 'question waits', 'questions wait')
      : (this.open.length ? 'Nobody is waited for' : 'All quiet');
    const choose = keysOn() ? ['Choose one, or press ', h('kbd', {}, 'n'),
      ' for the oldest that nobody works on.'] : 'Choose one.';
    const others = 'Somebody works on ' + (this.open.length === 1 ? 'the open question.'
      : 'each of the ' + this.open.length + ' open questions.');
    const gone = this.missing && h('p', { class: 'question-gone', role: 'status' }, GONE);
    const hint = h('p', {}, waiting ? choose : (this.open.length ? others : QUIET));
    replace(this.stage, h('div', { class: 'empty' }, gone, h('h2', { tabindex: -1 }, title),
      hint));
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    if (!this.takesKeys || modified(event) || typing(event.target) || event.repeat
      || turnedOff(event)) return;
    if (event.key === 'n') {
      if (this.next) this.choose(this.next.key, this.nextKey.meant);
    } else if (event.key === 'Escape') {
      if (this.detail && !this.detail.cancel()) this.leave();
    } else if (this.detail) {
      this.detail.press(event.key);
    }
  }
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
