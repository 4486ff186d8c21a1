// @ts-check
// The queue of all robots' open questions, and the one that is worked on.
import { waits } from '../page/alerts.js';
import { SETTLING_MS } from '../page/deliberate.js';
import { NO_EMERGENCY_STOP } from '../page/emergency.js';
import { h, modified, replace, typing } from '../page/dom.js';
import { focusIsFree, moveFocus } from '../page/focus.js';
import { counted } from '../page/format.js';
import { Cards, keep, redraw, render, whenLetGo } from '../page/redraw.js';
import { SettledKey } from '../page/settled_keys.js';
import { keysOn, turnedOff } from '../page/shortcuts.js';
import { AlikeAnswer } from './alike_answer.js';
import { unreachedWords } from './calls.js';
import { tellPresses } from './presence.js';
import { QuestionDetail } from './question_detail.js';
import { QueueTools, queueList } from './queue_view.js';

/** @type {page.Panel} */
export const questions = { id: 'questions', title: 'Questions',
  create: (app) => new QuestionPanel(app) };

const SECTIONS = new RegExp('^(?:questions|servers|reach|onlookers|manipulation|interface_output'
  + '|sensors|cameras|preconditions|images|replays|(?:live|graph) .*)$');
const NO_SERVER = 'No robot with an expert query server is known yet.';
const MOST_NAMED = 3; // query servers
const GONE = 'The question of this address is not open: it was answered or taken back, or its time '
  + 'was over.';
const QUIET = 'Robots recover by themselves where they can; they ask here where they cannot.';

class QuestionPanel {
  /** @param {page.App} app */
  constructor(app) {
    this.app = app;
    /** @type {QuestionDetail | AlikeAnswer | null} */
    this.detail = null;
    /** @type {string[]} */
    this.order = []; // keys, as the list has them, also of the one that is shown and gone
    /** @type {QuestionDetail | null} */
    this.aside = null; // still held: what took its place may have been opened by accident
    this.asideTimer = 0;
    /** @type {string | null} */
    this.wanted = null; // what an address names, until it is known whether it is open; '': the list
    this.missing = ''; // the question of an address, where it is not open
    this.tools = new QueueTools(() => this.showQueue());
    this.queue = h('div', { class: 'queue', 'aria-label': 'Open questions' });
    this.cards = new Cards(() => h('button', {}));
    this.side = h('aside', {});
    this.stage = h('div', { class: 'stage' });
    this.root = h('div', { class: 'panel questions' }, this.side, this.stage);
    this.nextKey = new SettledKey(() => this.next?.key || '');
    window.addEventListener('keydown', (event) => this.key(event));
    tellPresses(app, () => (this.detail?.held ? this.detail.key : ''));
    this.showStage();
    this.showSide();
  }

  get open() { return this.app.store.questions; }

  /** What `n` would open: of those that nobody works on the next on the list, and round again. */
  get next() {
    if (!this.takesKeys || !keysOn()) return undefined;
    const at = this.order.indexOf(this.detail?.key || '') + 1;
    const free = [...this.order.slice(at), ...this.order.slice(0, at)]
      .map((each) => this.open.find(({ key }) => key === each));
    return free.find((each) => each && each.status === 'pending' && !this.isChosen(each.key));
  }

  get takesKeys() {
    return this.app.current === 'questions' && !document.querySelector('dialog[open]');
  }

  badge() { return this.open.filter(waits).length; }

  get sections() { return SECTIONS; }

  /** A claim is kept, and what robots do after an answer is followed, behind other panels, too. */
  get always() { return true; }

  shown() { if (this.detail) this.detail.shown(); }

  connected() { if (this.detail) this.detail.connected(); }

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

  /** @param {string[]} [names] of sections that have changed; else it may be any */
  draw(names) {
    /** @param {...string} wanted */
    const changed = (...wanted) => !names || wanted.some((name) => names.includes(name));
    // a console that has just begun may not have heard of it yet
    const comes = this.open.some(({ key }) => key === this.missing);
    if (comes && !this.detail && this.app.current === 'questions') this.wanted = this.missing;
    const focused = this.root.contains(document.activeElement);
    if (changed('questions')) this.arrive();
    if (changed('servers', 'reach')) this.showSide();
    if (changed('questions', 'onlookers')) this.showQueue();
    if (this.detail) this.detail.draw(names);
    else {
      if (changed('questions')) this.showStage();
      if (focused && focusIsFree()) this.focusFirst(); // what had the focus has gone
    }
  }

  showSide() {
    const servers = this.app.store.get('servers') || [];
    const gone = servers.filter(({ connected }) => !connected).map(({ name }) => name + ' (gone)');
    const names = servers.length > MOST_NAMED
      ? [counted(servers.length, 'expert query server'), ...gone]
      : servers.map(({ name, connected }) => name + (connected ? '' : ' (gone)'));
    const unreached = unreachedWords(this.app);
    render(this.side, h('aside', { class: 'queue-side' }, keep(this.tools.root), keep(this.queue),
      h('p', { class: 'problem unreached', role: 'status', hidden: !unreached }, unreached),
      h('p', { class: 'dim servers' },
        servers.length ? 'Listening to ' + names.join(', ') : NO_SERVER),
      // where the top bar is too narrow
      h('p', { class: 'dim servers ages-below' },
        'Heard: ' + this.app.liveness.ages() + ' ago'),
      h('p', { class: 'dim servers no-emergency-stop' }, NO_EMERGENCY_STOP)));
  }

  showQueue() {
    const { open, app } = this;
    const groups = this.tools.groups(app);
    const keys = groups.flatMap(({ questions }) => questions.map(({ key }) => key));
    const chosen = this.detail?.key || '';
    if (chosen && !keys.includes(chosen)) {
      const at = Math.max(0, this.order.indexOf(chosen)); // where it was
      keys.splice(at, 0, chosen);
    }
    this.order = keys;
    redraw(this.queue, groups.length ? queueList(app, this.cards, groups, this.ways)
      : h('p', { class: 'empty' }, open.length ? [counted(open.length, 'open question'),
        ', none of which is wanted. ', h('button', { class: 'inline', 'data-action': 'show-all',
          onclick: () => this.showAll() }, 'Show all')] : 'No open questions.'));
  }

  /** @type {import('./queue_view.js').Ways} */
  get ways() {
    return { isChosen: (key) => this.isChosen(key), choose: (...each) => this.choose(...each),
      answerAlike: (alike) => this.answerAlike(alike) };
  }

  showAll() {
    this.tools.clear();
    this.showQueue();
  }

  /** @param {string} alike which group */
  answerAlike(alike) {
    const group = this.tools.groups(this.app).find((each) => each.alike === alike);
    if (!group) return;
    this.close();
    this.turnTo(new AlikeAnswer(this.app, group.questions, () => this.leave()));
  }

  /** @param {string} key */
  isChosen(key) { return Boolean(this.detail && this.detail.key === key); }

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
    const before = this.detail;
    if (!meant && before instanceof QuestionDetail && before.held && !before.settled) {
      this.putAside(before);
    } else this.close();
    this.turnTo(back || new QuestionDetail(this.app, question,
      { leave: () => this.leave(), choose: (...next) => this.choose(...next) }));
    if (back) back.draw(); // what it has missed
    this.app.went();
  }

  /** @param {QuestionDetail | AlikeAnswer} detail */
  turnTo(detail) {
    this.detail = detail;
    this.showStage();
    this.showQueue();
    moveFocus(detail.title);
    detail.begin();
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
    this.focusFirst();
  }

  focusFirst() {
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
    const { detail, stage } = this;
    this.root.classList.toggle('working', Boolean(detail));
    if (!detail) {
      whenLetGo(stage, () => { // a question may be open by then
        if (!this.detail) redraw(stage, this.emptyStage());
      });
    } else if (detail.root.parentElement !== stage) {
      replace(stage, detail.root);
      stage.scrollTop = 0;
    }
  }

  emptyStage() {
    const waiting = this.badge();
    const open = this.open.length;
    const title = waiting ? counted(waiting, 'question waits', 'questions wait')
      : (open ? 'Nobody is waited for' : 'All quiet');
    const choose = keysOn() ? ['Choose one, or press ', h('kbd', {}, 'n'),
      ' for the next that nobody works on, and ', h('kbd', {}, '/'), ' to search.'] : 'Choose one.';
    const others = 'Somebody works on ' + (open === 1 ? 'the open question.'
      : 'each of the ' + open + ' open questions.');
    return h('div', { class: 'empty' },
      this.missing && h('p', { class: 'question-gone', role: 'status' }, GONE),
      h('h2', { tabindex: -1 }, title), h('p', {}, waiting ? choose : (open ? others : QUIET)));
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    if (!this.takesKeys || modified(event) || typing(event.target) || event.repeat
      || turnedOff(event)) return;
    if (event.key === 'n') {
      if (this.next) this.choose(this.next.key, this.nextKey.meant);
    } else if (event.key === '/' && !this.tools.root.hidden && !this.detail) {
      event.preventDefault(); // it would be typed
      this.tools.search.focus();
    } else if (event.key === 'Escape') {
      if (this.detail && !this.detail.cancel()) this.leave();
    } else if (this.detail) {
      this.detail.press(event.key);
    }
  }
}
