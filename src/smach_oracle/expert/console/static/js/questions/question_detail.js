// @ts-check
// One question: what failed and why, everything that may be answered, and what the robot does then.
import { AnswerForm } from '../answering/answer_form.js';
import { FollowUp } from '../answering/follow_up.js';
import { InterfacePanel } from '../interfaces/interface_panel.js';
import { PerceptionPanel } from '../interfaces/perception_panel.js';
import { NoReply, unlessLost } from '../page/connection.js';
import { h, replace } from '../page/dom.js';
import { focusIsFree, moveFocus } from '../page/focus.js';
import { duration } from '../page/format.js';
import { aged } from '../page/liveness.js';
import { keep, redraw, render } from '../page/redraw.js';
import { MachineHand } from '../robots/machine_hand.js';
import { MachineView, machinesNow } from '../robots/machine_view.js';
import { LastSeconds } from '../sensors/last_seconds.js';
import { callsWords } from './calls.js';
import { claimBar } from './claim_bar.js';
import { lookAt, lookAway, namesOf } from './onlookers.js';
import { URGENT_S } from './queue_view.js';
import { failureCard, userdataCard, visitsCard } from './situation_cards.js';
import { SituationCamera } from './situation_camera.js';

const RETRY_MS = 3000; // after a claim that was lost, and could not be made again
const LOST = 'The connection was lost before the robot had confirmed. Send it again: the same '
  + 'answer twice does no harm.';
const OLD = ' any more. What is shown is old, and no answer is sent until it is heard again.';
const NOT_TAKEN = 'The question could not be taken, so no answer was sent. Send it again.';
const UNKNOWN = 'The robot has not confirmed in time: whether it has your answer is not known. The '
  + 'same answer twice does no harm.';

export class QuestionDetail {
  /**
   * @param {page.App} app
   * @param {server.Question} question as it was when it was chosen
   * @param {import('../answering/follow_up.js').Ways} ways
   */
  constructor(app, question, ways) {
    this.app = app;
    this.question = question;
    this.ways = ways;
    this.holderBefore = ''; // when this page claimed it last
    this.claimed = Promise.resolve(); // the latest claim has its reply
    this.settled = this.held = false; // this page has answered it, or claimed it
    this.claimedAt = -Infinity; // ms, when it was tried last
    this.claiming = this.sending = this.ended = false; // ended: it is shown no longer
    this.problem = this.takenWords = ''; // the latter when somebody has taken it over
    /** @type {FollowUp | null} */
    this.followUp = null;
    /** @type {PerceptionPanel | null} */
    this.perceptionPanel = null;
    /** @type {InterfacePanel | null} */
    this.interfacePanel = null;
    this.interfaceSeen = false;
    this.machine = new MachineView(machinesNow(app.store), () => question, () => {});
    this.hand = new MachineHand(app, () => question);
    this.camera = new SituationCamera(app, question);
    this.lastSeconds = new LastSeconds(app);
    this.way = h('div', {}, visitsCard(question));
    this.perceptionPlace = h('div', { class: 'workbench' });
    this.interfacePlace = h('div', { class: 'workbench' });
    /** @type {string | null} */
    this.robotGone = null; // how it went, and the question with it; null: it was open until now
    this.wentAt = Infinity; // ms, when the question went; -Infinity: its robot was heard since
    this.form = new AnswerForm(question, (answer) => this.answer(answer),
      () => { if (this.mayBegin && !this.settled) this.take(); });
    this.answers = h('section', { class: 'card answers' }, h('h3', {}, 'What should it do?'),
      this.form.root);
    this.title = h('h2', { tabindex: -1 }, question.state, ' ', question.stands);
    this.top = h('div', {});
    this.root = this.build();
    this.show();
  }

  build() {
    const { question } = this;
    this.machine.draw();
    this.hand.draw();
    return h('article', { class: 'detail', 'data-question': question.key }, this.top,
      this.perceptionPlace, this.interfacePlace,
      h('div', { class: 'detail-body' },
        h('div', { class: 'situation' }, failureCard(question), this.camera.root,
          this.lastSeconds.root,
          h('section', { class: 'card mini-machine' }, this.hand.root, this.machine.root),
          this.way, userdataCard(question)),
        this.answers));
  }

  /**
   * What may change while something below is held.
   * @param {string} silent who must be heard, and is not
   */
  topView(silent) {
    const { app, question, key, now, mine, settled, held, claiming, sending, problem } = this;
    const { robot, path } = question;
    const { mayAnswer, expert } = app;
    const age = app.liveness.robot(robot);
    const names = namesOf(app, key);
    const calls = callsWords(app, key);
    const left = now && now.deadline !== null ? now.deadline - app.store.now() : Infinity;
    return h('div', { class: 'detail-top' }, h('header', { class: 'detail-head' },
      h('button', { class: 'back', 'aria-label': 'Back to the list',
        onclick: this.ways.leave }, '‹'),
      h('div', {}, keep(this.title), h('p', { class: 'dim' }, robot, ' · ', path, ' ',
        h('span', { class: 'dim last-word' }, age !== null && 'heard ' + aged(age) + ' ago'))),
      h('span', { class: 'spacer' }),
      h('span', { class: 'time' + (left < URGENT_S ? ' urgent' : '') }, now && !settled && ('asked '
        + duration(app.store.now() - now.asked) + ' ago · '
        + (left === Infinity ? 'no time limit' : duration(left) + ' left')))),
    h('div', { key: 'silence', class: 'silence-bar', hidden: !silent },
      h('span', { role: 'alert' }, silent && 'Nothing is heard from ' + silent + OLD)),
    claimBar({ now, mine, settled, held, claiming, sending, problem, mayAnswer, expert,
      gone: this.robotGone || '', silent: Boolean(now && !settled && silent) }, {
      leave: this.ways.leave, claim: () => this.claim('claim'),
      takeOver: () => this.claim('take_over') }),
    h('p', { key: 'onlookers', class: 'dim onlookers', role: 'status', hidden: !names.length },
      names.length > 0 && 'Also looking at it: ' + names.join(', ') + '.'),
    h('p', { key: 'calls', class: 'dim calls', hidden: !calls }, calls));
  }

  get key() { return this.question.key; }

  /** The question as it stands; undefined where it is open no longer. */
  get now() { return this.app.store.questions.find((each) => each.key === this.key); }

  get mine() {
    const { now } = this;
    return Boolean(now && now.status === 'claimed' && this.app.isMine(now));
  }

  /** Show it. To read it takes nothing. */
  begin() {
    lookAt(this.app, this.key);
    if (this.app.mayAnswer && this.mine) this.claim('claim'); // by a page of before: keep it
    this.draw();
  }

  /** The connection is back: so is the claim, if nobody has taken it meanwhile. */
  connected() {
    lookAt(this.app, this.key);
    if (this.held && !this.settled) this.claim('claim');
    if (this.followUp) this.followUp.watch();
  }

  /** It is looked at again: meanwhile another panel may have watched another trial. */
  shown() { if (this.followUp) this.followUp.watch(); }

  end() {
    if (this.held && !this.settled) this.release();
    this.ended = true;
    lookAway(this.app, this.key);
    this.pause();
    this.camera.stop();
    this.lastSeconds.end();
    if (this.perceptionPanel) this.perceptionPanel.stop();
    if (this.followUp) this.followUp.stop();
  }

  /** Nothing is about to be sent, and no hand is driven, while nobody sees it. */
  pause() {
    this.form.cancel();
    this.endInterface();
  }

  release() {
    this.app.connection.request('release', { question: this.key }).catch(() => {});
  }

  /**
   * Ask for the question, unless that was asked already.
   * @param {'claim' | 'take_over'} command
   */
  claim(command) {
    if (!this.claiming) this.claimed = this.sendClaim(command);
    return this.claimed;
  }

  /** With the first key or tap of an answer. Whether it is this page's then. */
  async take() {
    if (this.held || this.mine) return true;
    await this.claim('claim');
    return this.held;
  }

  /** @param {'claim' | 'take_over'} command */
  async sendClaim(command) {
    this.claiming = true;
    this.problem = '';
    this.holderBefore = this.otherHolder;
    this.claimedAt = performance.now();
    try {
      const reply = await this.app.connection.request(command, { question: this.key });
      // who is out of reach, or was restarted and has not heard of it yet, has given it to nobody
      const unclaimed = this.free || !this.now;
      this.held = reply.ok || (command === 'claim' && this.held && unclaimed);
      if (!reply.ok) this.problem = reply.message;
      if (this.ended && reply.ok && !this.settled) this.release();
    } catch (err) {
      unlessLost(err);
    }
    this.claiming = false;
    this.show();
  }

  /** @param {server.Answer} answer */
  async answer(answer) {
    if (this.sending || this.settled || !this.mayBegin) return;
    this.sending = true;
    this.problem = '';
    this.show();
    try {
      if (await this.take()) await this.send(answer);
      else this.problem = this.problem || NOT_TAKEN;
    } catch (err) {
      unlessLost(err);
      this.problem = err instanceof NoReply ? UNKNOWN : LOST;
    }
    this.sending = false;
    this.show();
    if (!this.settled) this.form.takeFocusBack();
  }

  /** @param {server.Answer} answer */
  async send(answer) {
    const reply = await this.app.connection.request('answer', { question: this.key, ...answer });
    if (reply.ok) {
      this.held = false;
      this.turnTo(answer);
    } else {
      this.problem = reply.message;
    }
  }

  /** Take back what is not sent yet; whether there was any such thing. */
  cancel() { return !this.settled && this.form.cancel(); }

  /** @param {string} key */
  press(key) {
    const takeOver = this.top.querySelector('[data-action="take-over"]');
    if (key === 't') {
      if (takeOver instanceof HTMLElement) takeOver.click();
    } else if (this.mayBegin && !this.settled) this.form.press(key);
  }

  /** The tools of a perception interface, for as long as one runs for this question. */
  showPerception() {
    const running = this.key in (this.app.store.get('sensors')?.perception || {});
    if (running && !this.perceptionPanel && !this.ended) {
      this.perceptionPanel = new PerceptionPanel(this.app, this.question, () => this.follow());
      replace(this.perceptionPlace, this.perceptionPanel.root);
      this.perceptionPlace.scrollIntoView({ block: 'nearest' });
    } else if (!running && this.perceptionPanel) {
      this.perceptionPanel.stop();
      this.perceptionPanel = null;
      replace(this.perceptionPlace);
    }
  }

  /** Show what the robot does after an interface that somebody else may have started. */
  follow() {
    if (this.followUp) return;
    const { now } = this;
    this.turnTo({ kind: 'interface', name: now ? now.interface : '', container: '' });
    this.show();
  }

  /**
   * What the robot does takes the place of what it could do; where the page is narrow it comes
   * first.
   * @param {Pick<server.Answer, 'kind' | 'name' | 'container'>} answer
   */
  turnTo(answer) {
    const followUp = new FollowUp(this.app, this.question, this.ways);
    this.settled = true;
    this.followUp = followUp;
    followUp.begin(answer);
    const free = focusIsFree(this.root); // a person may be at work elsewhere
    replace(this.answers, followUp.root);
    if (free && this.app.current === 'questions') moveFocus(followUp.title);
    this.root.classList.add('answered');
    this.root.scrollIntoView({ block: 'start' });
  }

  /** What the interface that runs prints, its end, and the controls of the hand that it moves. */
  showInterface() {
    const { now } = this;
    const name = now && now.status === 'interface' && !this.ended ? now.interface : null;
    if (name === null) this.endInterface();
    else if (this.interfacePanel) this.interfacePanel.draw();
    else {
      this.interfacePanel = new InterfacePanel(this.app, this.question, name, () => this.follow());
      replace(this.interfacePlace, this.interfacePanel.root);
      this.interfaceSeen = false;
    }
    if (this.interfacePanel && this.interfacePanel.manipulation && !this.interfaceSeen) {
      this.interfaceSeen = true;
      this.interfacePlace.scrollIntoView({ block: 'start' }); // it comes in above what was pressed
    }
  }

  endInterface() {
    if (!this.interfacePanel) return;
    this.interfacePanel.stop();
    this.interfacePanel = null;
    replace(this.interfacePlace);
  }

  /**
   * Show it as it stands.
   * @param {string[]} [names] of sections that have changed; else it may be any
   */
  draw(names) {
    const { robot } = this.question;
    const ofOthers = /** @param {string} name */ (name) => name.startsWith('live ')
      && name !== 'live ' + robot;
    if (names?.every(ofOthers)) return;
    /** @param {...string} wanted */
    const changed = (...wanted) => !names || wanted.some((name) => names.includes(name));
    this.showPerception();
    this.showInterface();
    if (changed('images', 'cameras')) this.camera.draw();
    if (changed('replays')) { // what is shown stays where there is none any more
      const { lastSeconds } = this;
      lastSeconds.show(this.app.store.get('replays')?.[this.key] || lastSeconds.number);
    }
    if (changed('questions')) redraw(this.way, visitsCard(this.now || this.question));
    if (changed('questions', `live ${robot}`) || names?.some((name) => name.startsWith('graph '))) {
      this.machine.draw();
      this.hand.draw();
    }
    if (this.followUp) this.followUp.draw();
    this.showClaim();
  }

  /** Who holds the claim where it is not this browser; '' where nobody does. */
  get otherHolder() {
    const { now, app } = this;
    if (!now || !now.holder || app.isMine(now)) return '';
    if (now.holder !== app.expert) return now.holder;
    return now.session ? now.holder + ' (in another browser)' : ''; // '': it is not told yet
  }

  /** Whether nobody works on it. */
  get free() {
    const { now } = this;
    return Boolean(now && !now.holder && now.status === 'pending');
  }

  /** Whether a person may begin an answer here: it is this page's, or nobody's. */
  get mayBegin() {
    const taken = this.held && this.now?.status === 'claimed' && !this.otherHolder; // not told yet
    return this.app.mayAnswer && (this.mine || this.free || taken);
  }

  /** Keep the claim, or see that it is lost. */
  showClaim() {
    // a server that was restarted, or not reached for long, knows nobody who holds it
    if (this.held && this.free && this.app.connection.connected
      && !this.app.liveness.whoIsSilent(this.question)
      && performance.now() - this.claimedAt > RETRY_MS) this.claim('claim');
    if (this.mine) {
      this.holderBefore = ''; // whoever holds it next has taken it over
      if (this.problem === this.takenWords) this.problem = ''; // it is here again
    }
    const other = this.otherHolder;
    if (this.held && other && other !== this.holderBefore) { // else it is not told yet
      this.held = false;
      this.problem = this.takenWords = other + ' has taken this question over.';
    }
    this.show();
  }

  /** As it was when the question went; of one that is answered here nothing is said. */
  howItWent() {
    const { app: { liveness }, question, robotGone } = this;
    const nowMs = performance.now();
    this.wentAt = this.now || this.settled ? Infinity : Math.min(this.wentAt, nowMs);
    if (this.wentAt === Infinity) return null;
    const age = liveness.robot(question.robot);
    if (robotGone === '' && age !== null && age < (nowMs - this.wentAt) / 1000) {
      this.wentAt = -Infinity; // what becomes of it now has nothing to do with the question
    }
    // a robot that was killed counts as silent only after a while
    return robotGone || (this.wentAt === -Infinity ? '' : liveness.gone(question));
  }

  show() {
    const { app, key, now, settled, question } = this;
    this.robotGone = this.howItWent();
    const silent = app.liveness.whoIsSilent(question);
    render(this.top, this.topView(now && !settled ? silent : ''));
    this.root.classList.toggle('silent', Boolean((now && !settled && silent) || this.robotGone));
    this.form.show(this.mayBegin && !this.sending && !settled && !silent,
      app.store.get('preconditions')?.[key] || {}, app.store.now());
  }
}
