// One trial, to be replayed: a cursor on its time axis, the machine as it stood then, and what happened in words.
import { Course, activePath, liveAt } from './course.js';
import { h, replace, setText, typing } from './dom.js';
import { added, chip } from './format.js';
import { MachineView } from './machines.js';
import { StillView } from './situation_camera.js';
import { Timeline } from './timeline.js';

const SPEEDS = [0.25, 1, 4, 16, 64, 256];
const ROBOT = 'replayed';

export class Replay {
  // `onCursor(event)`: the event under the cursor is another one now
  constructor(app, onCursor) {
    Object.assign(this, { app, onCursor });
    this.course = new Course();
    this.graphs = () => null;
    this.following = true;
    this.playing = false;
    this.t = 0;
    this.index = -1;
    this.timeline = new Timeline({ onSeek: (t) => this.seek(t), onPick: (seq) => this.pick(seq), onKey: (event) => this.key(event) });
    this.view = new MachineView({ get: (name) => this.section(name) }, (path) => this.open(path));
    this.path = h('div', { class: 'chips replay-path', 'aria-label': 'What is active' });
    this.words = h('p', { class: 'replay-words', role: 'status' });
    this.question = h('div', { class: 'replay-question', hidden: true });
    this.time = h('span', { class: 'number replay-time' });
    this.container = h('select', { class: 'replay-container', 'aria-label': 'Machine that is shown', onchange: () => this.open(this.container.value) });
    this.stage = h('div', { class: 'replay-stage' }, h('div', { class: 'row replay-head' }, this.path, h('span', { class: 'spacer' }), this.container), this.view.root);
    this.root = h('div', { class: 'replay', onkeydown: (event) => this.keyOutside(event) }, this.controls(), this.timeline.root, this.words, this.question, this.stage);
  }

  controls() {
    const button = (sign, title, onclick, id) => h('button', { class: 'tool', type: 'button', title, 'aria-label': title, onclick, 'data-replay': id }, sign);
    this.play = button('▶', 'Play', () => this.toggle(), 'play');
    this.speed = h('select', { class: 'replay-speed', 'aria-label': 'Speed' }, SPEEDS.map((each) => h('option', { value: each, selected: each === 1 }, each + '×')));
    this.live = h('button', { class: 'tool replay-live', type: 'button', title: 'Follow what happens', onclick: () => this.follow(true), 'data-replay': 'live' }, 'Live');
    return h('div', { class: 'row replay-controls', role: 'group', 'aria-label': 'Replay' }, button('|◂', 'To the beginning', () => this.to(0), 'first'), button('◂', 'One event back', () => this.step(-1), 'back'),
      this.play, button('▸', 'One event on', () => this.step(1), 'on'), button('▸|', 'To the end', () => this.to(this.course.events.length - 1), 'last'), this.speed, this.live, h('span', { class: 'spacer' }), this.time);
  }

  // `events` of a trial, so far; `end`: of the axis, in s since the epoch; `graphs(path)`: a container's drawing;
  // `running`: whether more is to come; `trial`: its id, so that another one begins anew; `stills`: by question, what
  // cameras saw
  set(trial, events, end, graphs, running, stills) {
    const another = trial !== this.trial;
    this.trial = trial;
    this.graphs = graphs;
    this.running = running;
    this.stills = stills || {};
    this.course.set(events);
    this.end = Math.max(end, this.course.end);
    if (another) {
      this.stop();
      this.chosen = '';
      this.follow(true);
    }
    this.live.hidden = !running;
    this.timeline.set(events, this.end);
    if (this.following) this.place(this.end);
    else this.show();
  }

  section(name) {
    if (name === 'live ' + ROBOT) return this.shownLive;
    return name.startsWith('graph ' + ROBOT + ' ') ? this.graphs(name.slice(7 + ROBOT.length)) : undefined;
  }

  // The drawings have come, or changed.
  redraw() { if (this.course.events.length) this.draw(); }

  follow(on) {
    this.following = on;
    this.live.setAttribute('aria-pressed', on);
    if (on) {
      this.stop();
      if (this.course.events.length) this.place(this.end);
    }
  }

  seek(t) {
    this.follow(false);
    this.place(t);
  }

  to(index) {
    if (index < 0 || !this.course.events.length) return;
    this.follow(false);
    this.place(this.course.events[index].t, index);
  }

  pick(seq) { this.to(this.course.events.findIndex((event) => event.seq === seq)); }

  step(by, landmarks) {
    this.stop();
    this.to(this.course.next(this.index, by, landmarks));
  }

  // `index`: of several events of one moment the one that is meant.
  place(t, index) {
    const { course } = this;
    this.t = Math.min(this.end, Math.max(course.begin, t));
    this.at = index === undefined ? course.indexAt(this.t) : index;
    this.show();
  }

  show() {
    const { course } = this;
    if (!course.events.length) return;
    const whole = this.end - course.begin;
    const event = course.events[Math.max(0, this.at)];
    this.timeline.place(this.t, seconds(this.t - course.begin) + ': ' + said(event));
    setText(this.time, seconds(this.t - course.begin) + ' of ' + seconds(whole));
    const key = this.trial + ' ' + this.at;
    if (key === this.shown) return;
    this.shown = key;
    this.index = this.at;
    this.timeline.pick(event.seq);
    setText(this.words, said(event));
    this.words.className = 'replay-words ' + event.kind;
    this.draw();
    this.onCursor(event);
  }

  draw() {
    const now = this.course.at(Math.max(0, this.index));
    const event = this.course.events[Math.max(0, this.index)];
    const paths = [...new Set(this.course.events.map((each) => each.path))].filter(Boolean).sort();
    const oracleOf = (path) => (this.graphs(path) || {}).oracle || 'ORACLE';
    this.shownLive = liveAt(now, paths, oracleOf);
    const active = activePath(now);
    const deepest = active.length ? active[active.length - 1][0] : event.path;
    this.showPath(active, now);
    this.showQuestion(now.question);
    const shown = paths.includes(this.chosen) ? this.chosen : this.graphs(deepest) || !this.graphs(event.path) ? deepest : event.path;
    this.showContainers(paths, shown);
    this.view.show(ROBOT, shown);
  }

  showPath(active, now) {
    const key = JSON.stringify([active, now.failed]);
    if (key === this.pathKey) return;
    this.pathKey = key;
    replace(this.path, active.length ? active.map(([path, label], index) => [index > 0 && h('span', { class: 'dim' }, '›'),
      chip(label, now.failed[path] ? 'bad' : 'accent', path + '/' + label)]) : h('span', { class: 'dim' }, 'Nothing is active.'));
  }

  showContainers(paths, shown) {
    const key = JSON.stringify([paths, this.chosen]);
    if (key !== this.containersKey) {
      this.containersKey = key;
      replace(this.container, h('option', { value: '' }, 'follow what is active'), paths.map((path) => h('option', { value: path, selected: path === this.chosen }, path)));
      this.container.hidden = paths.length < 2;
    }
    this.container.title = shown;
  }

  showQuestion(question) {
    const key = JSON.stringify(question);
    if (key === this.questionKey) return;
    this.questionKey = key;
    this.question.hidden = !question;
    if (!question) return;
    const { answer } = question;
    replace(this.question, h('div', { class: 'replay-told' }, h('p', {}, h('strong', {}, 'Question about ', question.state), question.reason && ': ' + question.reason,
      question.holder && !answer && [' ', chip(question.holder + ' works on it', 'warn')]),
    question.steps.map((step) => h('p', { class: 'dim' }, step)),
    answer ? h('p', { class: 'replay-answer' }, h('strong', {}, 'Answer'), answer.by && ' of ' + answer.by, ': ', answer.kind.replace('_', ' '), answer.target && ' ' + answer.target, answer.why && h('span', { class: 'dim' }, ' – ' + answer.why))
      : h('p', { class: 'dim' }, question.closed ? 'No answer: ' + question.closed + '.' : 'Not answered yet.')), this.pictures(question.query));
  }

  // What cameras saw at the failure; asked for once.
  pictures(query) {
    const stills = this.stills[query] || [];
    if (!stills.length) return null;
    if (this.picturesOf !== stills) {
      this.picturesOf = stills;
      this.picturesRoot = h('div', { class: 'replay-stills' }, stills.map((still) => new StillView(this.app, still).root));
    }
    return this.picturesRoot;
  }

  open(path) {
    this.chosen = path;
    this.draw();
  }

  toggle() {
    if (this.playing) {
      this.stop();
      return;
    }
    if (!this.course.events.length) return;
    if (this.t >= this.end - 1e-3) this.to(0);
    this.follow(false);
    this.playing = true;
    this.showPlay();
    let last = performance.now();
    const frame = (time) => {
      if (!this.playing) return;
      const passed = Math.max(0, time - last) / 1000;
      last = time;
      if (!this.root.isConnected) this.stop();
      else this.place(this.t + passed * Number(this.speed.value));
      if (this.t >= this.end && !this.running) this.stop();
      else requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  }

  stop() {
    this.playing = false;
    this.showPlay();
  }

  showPlay() {
    const title = this.playing ? 'Pause' : 'Play';
    setText(this.play, this.playing ? '❚❚' : '▶');
    this.play.title = title;
    this.play.setAttribute('aria-label', title);
    this.words.setAttribute('aria-live', this.playing ? 'off' : 'polite');
  }

  key(event) {
    const act = { ArrowLeft: () => this.step(-1), ArrowDown: () => this.step(-1), ArrowRight: () => this.step(1), ArrowUp: () => this.step(1),
      PageUp: () => this.step(1, true), PageDown: () => this.step(-1, true), Home: () => { this.stop(); this.to(0); },
      End: () => { this.stop(); this.to(this.course.events.length - 1); }, ' ': () => this.toggle() }[event.key];
    if (!act || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    event.stopPropagation();
    act();
  }

  // The same keys wherever in the replay one is, but where they mean something else.
  keyOutside(event) {
    if (typing(event.target) || (event.key === ' ' && event.target.closest('button')) || event.target.closest('.graph-frame')) return;
    this.key(event);
  }
}

function said(event) {
  return (event.words || event.kind) + (event.kind === 'failure' ? added(event) : '');
}

function seconds(number) {
  return '+' + (number < 100 ? number.toFixed(2) : number.toFixed(1)) + ' s';
}
