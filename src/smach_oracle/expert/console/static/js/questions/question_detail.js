// @ts-check
// One question: what failed and why, everything that may be answered, and what the robot does then.
import { AnswerForm } from '../answering/answer_form.js';
import { FollowUp } from '../answering/follow_up.js';
import { InterfacePanel } from '../interfaces/interface_panel.js';
import { PerceptionPanel } from '../interfaces/perception_panel.js';
import { NoReply, unlessLost } from '../page/connection.js';
import { h, replace, say, setText } from '../page/dom.js';
import { focusIsFree, moveFocus } from '../page/focus.js';
import { duration } from '../page/format.js';
import { redraw } from '../page/redraw.js';
import { MachineHand } from '../robots/machine_hand.js';
import { MachineView, machinesNow } from '../robots/machine_view.js';
import { callsWords } from './calls.js';
import { ClaimBar } from './claim_bar.js';
import { LastSeconds } from './last_seconds.js';
import { Onlookers } from './onlookers.js';
import { URGENT_S } from './queue_view.js';
import { SilenceBar } from './silence_bar.js';
import { failureCard, userdataCard, visitsCard } from './situation_cards.js';
import { SituationCamera } from './situation_camera.js';

const RETRY_MS = 3000; // after a claim that was lost, and could not be made again
const LOST = 'The connection was lost before the robot had confirmed. Send it again: the same '
  + 'answer twice does no harm.';
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
    this.machine = new MachineView(machinesNow(app.store), () => {});
    this.hand = new MachineHand(app);
    this.camera = new SituationCamera(app, question);
    this.lastSeconds = new LastSeconds(app, question.key);
    this.way = h('div', {}, visitsCard(question));
    this.perceptionPlace = h('div', { class: 'workbench', hidden: true });
    this.interfacePlace = h('div', { class: 'workbench', hidden: true });
    this.time = h('span', { class: 'time' });
    this.silence = new SilenceBar(app.liveness, question);
    this.onlookers = new Onlookers(app, question);
    this.calls = h('p', { class: 'dim calls', hidden: true });
    /** @type {string | null} */
    this.robotGone = null; // how it went, and the question with it; null: it was open until now
    this.claimBar = new ClaimBar({ leave: ways.leave, claim: () => this.claim('claim'),
      takeOver: () => this.claim('take_over') });
    this.form = new AnswerForm(question, (answer) => this.answer(answer),
      () => { if (this.mayBegin && !this.settled) this.take(); });
    this.answers = h('section', { class: 'card answers' }, h('h3', {}, 'What should it do?'),
      this.form.root);
    this.title = h('h2', { tabindex: -1 }, question.state, ' ', question.stands);
    this.root = this.build();
    this.show();
  }

  build() {
    const { question } = this;
    this.machine.show(question.robot, question.path);
    this.hand.show(question.robot, question.path);
    return h('article', { class: 'detail', 'data-question': question.key }, this.head(),
      this.silence.root, this.claimBar.root, this.onlookers.root, this.calls,
      this.perceptionPlace, this.interfacePlace,
      h('div', { class: 'detail-body' },
        h('div', { class: 'situation' }, failureCard(question), this.camera.root,
          this.lastSeconds.root,
          h('section', { class: 'card mini-machine' }, this.hand.root, this.machine.root),
          this.way, userdataCard(question)),
        this.answers));
  }

  head() {
    const { robot, path } = this.question;
    return h('header', { class: 'detail-head' },
      h('button', { class: 'back', 'aria-label': 'Back to the list',
        onclick: this.ways.leave }, '‹'),
      h('div', {}, this.title,
        h('p', { class: 'dim' }, robot, ' · ', path, ' ', this.silence.age)),
      h('span', { class: 'spacer' }), this.time);
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
    this.showPerception();
    this.showInterface();
    this.onlookers.look();
    say(this.calls, callsWords(this.app, this.key));
    if (this.app.mayAnswer && this.mine) this.claim('claim'); // by a page of before: keep it
    this.show();
  }

  /** The connection is back: so is the claim, if nobody has taken it meanwhile. */
  connected() {
    this.onlookers.look();
    if (this.held && !this.settled) this.claim('claim');
    if (this.followUp) this.followUp.watch();
  }

  /** It is looked at again: meanwhile another panel may have watched another trial. */
  shown() { if (this.followUp) this.followUp.watch(); }

  end() {
    if (this.held && !this.settled) this.release();
    this.ended = true;
    this.onlookers.leave();
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
      // who is out of reach has given it to nobody else
      this.held = reply.ok || (command === 'claim' && this.held && this.free);
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
    if (key === 't') this.claimBar.press('take-over');
    else if (this.mayBegin && !this.settled) this.form.press(key);
  }

  tick() {
    this.showClaim();
    say(this.calls, callsWords(this.app, this.key));
    this.hand.update();
  }

  showTime() {
    const { now } = this;
    if (!now || this.settled) {
      setText(this.time, '');
      return;
    }
    const clock = this.app.store.now();
    const left = now.deadline === null ? Infinity : now.deadline - clock;
    this.form.showPreconditions(this.app.store.get('preconditions')?.[this.key] || {}, clock);
    setText(this.time, 'asked ' + duration(clock - now.asked) + ' ago · '
      + (left === Infinity ? 'no time limit' : duration(left) + ' left'));
    this.time.classList.toggle('urgent', left < URGENT_S);
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
    this.perceptionPlace.hidden = !this.perceptionPanel;
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
    else if (this.interfacePanel) this.interfacePanel.update();
    else {
      this.interfacePanel = new InterfacePanel(this.app, this.question, name, () => this.follow());
      replace(this.interfacePlace, this.interfacePanel.root);
      this.interfaceSeen = false;
    }
    this.interfacePlace.hidden = !this.interfacePanel;
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

  /** @param {string[]} names of sections */
  update(names) {
    /** @param {...string} wanted */
    const changed = (...wanted) => wanted.some((name) => names.includes(name));
    if (changed('questions', 'manipulation', 'interface_output', 'sensors', 'cameras')) {
      this.showInterface();
    }
    if (changed('preconditions')) this.showTime();
    if (changed('onlookers')) this.onlookers.show();
    if (changed('reach')) say(this.calls, callsWords(this.app, this.key));
    if (changed('images', 'cameras')) this.camera.update();
    if (changed('replays')) this.lastSeconds.update();
    if (changed('sensors')) this.showPerception();
    if (changed('questions')) {
      if (this.now) redraw(this.way, visitsCard(this.now)); // events may come after the question
      this.showClaim();
    }
    const machines = names.some((name) => name.startsWith('live ') || name.startsWith('graph '));
    if (machines || changed('questions')) {
      this.machine.update();
      this.hand.update();
    }
    if (this.followUp) this.followUp.update();
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
    if (this.now || this.settled) return null;
    return this.robotGone === null ? this.app.liveness.gone(this.question) : this.robotGone;
  }

  show() {
    const { now, mine, settled, held, claiming, sending, problem } = this;
    const { mayAnswer, expert } = this.app;
    const silent = Boolean(now && !settled && this.silence.show());
    this.robotGone = this.howItWent();
    this.claimBar.show({ now, mine, settled, held, claiming, sending, problem, mayAnswer, expert,
      gone: this.robotGone || '', silent });
    this.root.classList.toggle('silent', silent || Boolean(this.robotGone));
    this.form.enable(this.mayBegin && !sending && !settled && !silent);
    this.showTime();
  }
}
