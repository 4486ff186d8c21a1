// One question: what failed and why, everything that may be answered, and what the robot does then.
import { h, replace, setText } from './dom.js';
import { CLASSES, chip, duration, rateBar } from './format.js';
import { Lost } from './link.js';
import { MachineView } from './machines.js';
import { AnswerForm } from './answer_form.js';
import { FollowUp } from './follow_up.js';
import { InterfacePanel } from './interface_panel.js';
import { PerceptionPanel } from './perception_panel.js';
import { SituationCamera } from './situation_camera.js';

const VISITS = { success: ['✓', 'good'], failure: ['✗', 'bad'], superseded: ['☞', 'accent'], preempted: ['■', 'warn'] };

export class Detail {
  constructor(app, question, onLeave) {
    this.app = app;
    this.question = question;
    this.key = question.key;
    this.onLeave = onLeave;
    this.settled = '';
    this.claiming = false;
    this.machine = new MachineView(app.store, () => {});
    this.camera = new SituationCamera(app, question);
    this.workbench = h('div', { class: 'workbench', hidden: true });
    this.bench = h('div', { class: 'workbench', hidden: true });
    this.time = h('span', { class: 'time' });
    this.claimBar = h('div', { class: 'claim-bar', role: 'status' });
    this.form = new AnswerForm(question, (answer) => this.answer(answer));
    this.answers = h('section', { class: 'card answers' }, h('h3', {}, 'What shall it do?'), this.form.root);
    this.root = h('article', { class: 'detail', 'data-question': question.key }, this.head(), this.claimBar, this.workbench, this.bench,
      h('div', { class: 'detail-body' }, h('div', { class: 'situation' }, this.failure(), this.camera.root, this.machineCard(), this.visits(), this.userdata()), this.answers));
    this.machine.show(question.robot, question.path);
    this.show();
  }

  head() {
    const question = this.question;
    return h('header', { class: 'detail-head' },
      h('button', { class: 'back', 'aria-label': 'Back to the list', onclick: this.onLeave }, '‹'),
      h('div', {}, h('h2', {}, question.state, ' failed'), h('p', { class: 'dim' }, question.robot, ' · ', question.path)),
      h('span', { class: 'spacer' }), this.time);
  }

  failure() {
    const question = this.question;
    return h('section', { class: 'card failure' }, h('p', { class: 'what' }, question.state, ' ', question.what, '.'),
      question.text && h('pre', { class: 'text' }, question.text),
      h('dl', {}, fact('Failure rate', h('span', { class: 'chips' }, rateBar(question.rate), chip(CLASSES[question.class] || '?', 'class-' + question.class), question.continuous && chip('continuous', 'warn', 'It failed again without a success in between'))),
        fact('Asked because', question.reason), fact('Recoveries spent', question.recoveries),
        question.tried.length > 0 && fact('The oracle tried', h('ol', { class: 'tried' }, question.tried.map((step) => h('li', {}, step)))),
        question.deadline !== null && fact('If nobody answers', question.fallback || 'the fallback happens')));
  }

  machineCard() {
    return h('section', { class: 'card mini-machine' }, this.machine.root);
  }

  visits() {
    const history = this.question.history;
    return history.length > 0 && h('section', { class: 'card' }, h('h3', {}, 'How it came here'),
      h('ol', { class: 'visits' }, history.slice(-24).map((visit) => {
        const [sign, kind] = VISITS[visit.result] || ['?', ''];
        return h('li', { class: kind, title: visit.outcome }, visit.state, ' ', h('span', { class: 'sign' }, sign), visit.result === 'failure' && visit.outcome ? h('span', { class: 'dim' }, ' ' + visit.outcome) : null);
      })));
  }

  userdata() {
    const items = this.question.userdata;
    return items.length > 0 && h('section', { class: 'card' }, h('h3', {}, 'Userdata'), h('table', { class: 'userdata' }, h('tbody', {}, items.map((item) =>
      h('tr', {}, h('th', { scope: 'row' }, item.key), h('td', {}, item.value && item.value.length > 160
        ? h('details', {}, h('summary', {}, item.type || item.value.slice(0, 80) + '…'), h('pre', {}, item.value))
        : [item.value && h('code', {}, item.value), ' ', item.type && h('span', { class: 'dim' }, item.type)], item.note && h('span', { class: 'dim' }, ' ' + item.note)))))));
  }

  get now() { return (this.app.store.get('questions') || []).find((each) => each.key === this.key); }

  get mine() {
    const now = this.now;
    return Boolean(now && now.holder && now.holder === this.app.expert && now.status === 'claimed');
  }

  // Take the question, unless somebody else works on it.
  begin() {
    this.showWorkbench();
    this.showInterface();
    if (this.app.mayAnswer && this.question.status === 'pending') this.claim('claim');
    this.show();
  }

  // The connection is back: so is the claim, if nobody has taken it meanwhile.
  connected() {
    if (this.held && !this.settled) this.claim('claim');
    if (this.followUp) this.followUp.watch();
  }

  end() {
    if (this.held && !this.settled) this.app.link.request('release', { question: this.key }).catch(() => {});
    this.ended = true;
    this.camera.stop();
    if (this.perception) this.perception.stop();
    if (this.tools) this.tools.stop();
  }

  async claim(command) {
    if (this.claiming) return;
    this.claiming = true;
    this.problem = '';
    try {
      const reply = await this.app.link.request(command, { question: this.key });
      this.held = reply.ok;
      if (!reply.ok) this.problem = reply.message;
      if (this.ended && reply.ok && !this.settled) this.app.link.request('release', { question: this.key }).catch(() => {});
    } catch (err) {
      if (!(err instanceof Lost)) throw err;
    }
    this.claiming = false;
    this.show();
  }

  async answer(answer) {
    if (this.sending || this.settled || !this.mine) return;
    this.sending = true;
    this.problem = '';
    this.show();
    const followUp = new FollowUp(this.app, this.question, this.onLeave);
    try {
      const reply = await this.app.link.request('answer', Object.assign({ question: this.key }, answer));
      if (reply.ok) {
        this.held = false;
        this.turnTo(followUp, answer);
      } else {
        this.problem = reply.message;
      }
    } catch (err) {
      if (!(err instanceof Lost)) throw err;
      this.problem = 'The connection was lost before the robot had confirmed. Send it again: the same answer twice does no harm.';
    }
    this.sending = false;
    this.show();
  }

  press(key) {
    if (key === 't' && this.takeOver) this.takeOver.click();
    else if (this.mine && !this.settled) this.form.press(key);
  }

  tick() {
    const now = this.now;
    const clock = this.app.store.now();
    if (!now || this.settled) {
      setText(this.time, '');
      return;
    }
    const left = now.deadline === null ? 'no time limit' : duration(now.deadline - clock) + ' left';
    this.form.stand((this.app.store.get('conditions') || {})[this.key], clock);
    setText(this.time, 'asked ' + duration(clock - now.asked) + ' ago · ' + left);
    this.time.classList.toggle('urgent', now.deadline !== null && now.deadline - clock < 20);
  }

  // The tools of a perception interface, for as long as one runs for this question.
  showWorkbench() {
    const running = this.question.key in ((this.app.store.get('eye') || {}).perception || {});
    if (running && !this.perception && !this.ended) {
      this.perception = new PerceptionPanel(this.app, this.question, () => this.follow());
      replace(this.workbench, this.perception.root);
      this.workbench.scrollIntoView({ block: 'nearest' });
    } else if (!running && this.perception) {
      this.perception.stop();
      this.perception = null;
      replace(this.workbench);
    }
    this.workbench.hidden = !this.perception;
  }

  // Tell what the robot does after an interface that somebody else may have started.
  follow() {
    if (this.followUp) return;
    this.turnTo(new FollowUp(this.app, this.question, this.onLeave), { kind: 'interface', name: this.now ? this.now.interface : '' });
    this.show();
  }

  // What the robot does takes the place of what it could do; where the page is narrow it comes first.
  turnTo(followUp, answer) {
    this.settled = 'yours';
    this.followUp = followUp;
    followUp.begin(answer);
    replace(this.answers, followUp.root);
    this.root.classList.add('answered');
    this.root.scrollIntoView({ block: 'start' });
  }

  // What the interface that runs prints, its end, and the controls of the hand that it moves.
  showInterface() {
    const now = this.now;
    const running = Boolean(now && now.status === 'interface') && !this.ended;
    if (running && !this.tools) {
      this.tools = new InterfacePanel(this.app, this.question, now.interface, () => this.follow());
      replace(this.bench, this.tools.root);
      this.seen = false;
    } else if (running) {
      this.tools.update();
    } else if (this.tools) {
      this.tools.stop();
      this.tools = null;
      replace(this.bench);
    }
    this.bench.hidden = !this.tools;
    if (this.tools && this.tools.hand && !this.seen) {
      this.seen = true;
      this.bench.scrollIntoView({ block: 'start' }); // it comes in above what was pressed
    }
  }

  update(names) {
    if (names.some((name) => ['questions', 'hand', 'output', 'eye'].includes(name))) this.showInterface();
    if (names.includes('conditions')) this.tick();
    if (names.includes('stills')) this.camera.update();
    if (names.includes('eye')) {
      this.camera.update();
      this.showWorkbench();
    }
    if (names.includes('questions')) {
      const now = this.now;
      // a server that was restarted knows nobody who holds it
      if (now && this.held && !now.holder && now.status === 'pending' && this.app.link.connected) this.claim('claim');
      if (this.held && now && now.holder && now.holder !== this.app.expert) {
        this.held = false;
        this.problem = now.holder + ' has taken this question over.';
      }
      this.show();
    }
    if (names.some((name) => name === 'questions' || name.startsWith('live ') || name.startsWith('graph '))) this.machine.update();
    if (this.followUp) this.followUp.update(names);
  }

  show() {
    const now = this.now;
    this.takeOver = null;
    let bar = null;
    let kind = '';
    if (this.settled) bar = null;
    else if (!now) [bar, kind] = [['This question is closed: it was answered elsewhere, taken back, or its time was over. ', this.button('Back to the list', this.onLeave)], 'warn'];
    else if (now.status === 'interface') [bar, kind] = [['Interface ', h('strong', {}, now.interface), ' runs for it; ', h('strong', {}, now.holder || 'somebody'), ' started it.'], ''];
    else if (!this.app.mayAnswer) [bar, kind] = [['You are signed in as a viewer: you can watch, others answer.', now.holder && [' ', h('strong', {}, now.holder), ' works on it.']], ''];
    else if (this.mine) [bar, kind] = [this.sending ? 'Sending…' : ['It is yours. ', this.button('Leave it to others', this.onLeave)], 'good'];
    else if (now.holder) {
      this.takeOver = this.button('Take it over', () => this.claim('take_over'), 'take-over');
      [bar, kind] = [[h('strong', {}, now.holder), ' works on it. ', this.takeOver], 'warn'];
    } else bar = this.claiming || this.held ? 'Taking it…' : ['Nobody works on it. ', this.button('Take it', () => this.claim('claim'), 'claim')];
    const key = JSON.stringify([this.settled, Boolean(now), now && now.holder, now && now.status, this.problem, this.sending, this.claiming, this.mine, this.app.expert]);
    if (key !== this.barKey) {
      this.barKey = key;
      this.claimBar.className = 'claim-bar ' + kind;
      replace(this.claimBar, bar && h('span', {}, bar), this.problem && h('span', { class: 'problem', role: 'alert' }, this.problem));
      this.claimBar.hidden = !bar && !this.problem;
    }
    this.form.enable(this.mine && !this.sending && !this.settled);
    this.tick();
  }

  button(text, onclick, id) { return h('button', { class: 'inline', onclick, 'data-action': id }, text); }
}

function fact(name, value) {
  return [h('dt', {}, name), h('dd', {}, value)];
}
