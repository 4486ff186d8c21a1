// @ts-check
// One trial, to be replayed: a cursor on its time axis, the machine as it stood then, and what
// happened in words.
import { h, modified, pick, setText, typing } from '../page/dom.js';
import { added, chip } from '../page/format.js';
import { keep, render } from '../page/redraw.js';
import { MachineView } from '../robots/machine_view.js';
import { LastSeconds } from '../sensors/last_seconds.js';
import { MachineHistory, activePath, machineStateOf } from './machine_history.js';
import { replayControls } from './replay_controls.js';
import { ReplayQuestion } from './replay_question.js';
import { Timeline } from './timeline.js';

const ROBOT = 'replayed'; // stands for the trial's robot in the ids of its states
const FOLLOW = 'follow what is active';
/** @type {replay.ReplayedTrial} */
const NOTHING = { id: '', events: [], end: 0, running: false, graph: () => undefined, images: {},
  replays: {} };

export class TrialReplay {
  /**
   * @param {page.App} app
   * @param {(event: server.TrialEvent) => void} onCursor the event under the cursor is another
   *   one now
   */
  constructor(app, onCursor) {
    this.onCursor = onCursor;
    this.trial = NOTHING;
    this.history = new MachineHistory();
    this.following = true;
    this.playing = false;
    this.speed = 1; // of playing
    this.t = 0;
    this.end = 0;
    this.index = -1; // of the event under the cursor
    this.shown = ''; // which one is shown
    this.chosen = ''; // path of a container
    this.path = ''; // of the one that is shown
    /** @type {machine.MachineState} */
    this.state = { active: {}, latest: {}, failed: {}, rates: {}, counts: {}, paths: [] };
    this.timeline = new Timeline(this);
    this.controls = h('div', {});
    /** @type {machine.MachineSource} */
    const source = { graph: (_, path) => this.trial.graph(path), state: () => this.state };
    this.view = new MachineView(source, () => ({ robot: ROBOT, path: this.path }),
      (path) => this.open(path));
    this.words = h('p', { class: 'replay-words', role: 'status' });
    this.question = new ReplayQuestion(app);
    this.lastSeconds = new LastSeconds(app);
    this.stage = h('div', {});
    this.root = h('div', { class: 'replay', onkeydown: (event) => this.keyOutside(event) },
      this.controls, this.timeline.root, this.words, this.question.root, this.stage);
  }

  /** Index of the last event. */
  get last() { return this.trial.events.length - 1; }

  /** @param {replay.ReplayedTrial} trial another one begins at its start */
  set(trial) {
    const another = trial.id !== this.trial.id;
    this.trial = trial;
    this.history.set(trial.events);
    this.end = Math.max(trial.end, this.history.end);
    if (another) {
      this.stop();
      this.chosen = '';
      this.follow(true);
    }
    this.timeline.set(trial.events, this.end);
    if (this.following) this.place(this.end);
    else this.show();
  }

  /** The drawings have come, or changed. */
  redraw() { if (this.trial.events.length) this.draw(); }

  /** @param {boolean} on */
  follow(on) {
    this.following = on;
    if (on) this.stop();
    if (on && this.trial.events.length) this.place(this.end);
    this.drawControls();
  }

  /** @param {number} t */
  seek(t) {
    this.follow(false);
    this.place(t);
  }

  /** @param {number} index */
  to(index) {
    if (index < 0 || !this.trial.events.length) return;
    this.follow(false);
    this.place(this.trial.events[index].t, index);
  }

  /** @param {number} seq */
  pick(seq) { this.to(this.trial.events.findIndex((event) => event.seq === seq)); }

  /**
   * @param {1 | -1} by
   * @param {boolean} [landmarks] to the next event that is worth a stop
   */
  step(by, landmarks = false) {
    this.stop();
    this.to(this.history.next(this.index, by, landmarks));
  }

  /**
   * @param {number} t
   * @param {number} [index] of several events of one moment the one that is meant
   */
  place(t, index) {
    this.t = Math.min(this.end, Math.max(this.history.begin, t));
    this.index = index === undefined ? this.history.indexAt(this.t) : index;
    this.show();
  }

  show() {
    const { events, id } = this.trial;
    if (!events.length) return;
    const { begin } = this.history;
    const event = events[Math.max(0, this.index)];
    const now = seconds(this.t - begin);
    this.timeline.place(this.t, now + ': ' + wordsOf(event));
    this.drawControls();
    const key = id + ' ' + this.index;
    if (key === this.shown) return;
    this.shown = key;
    this.timeline.pick(event.seq);
    setText(this.words, wordsOf(event));
    this.words.className = 'replay-words ' + event.kind;
    this.draw();
    this.onCursor(event);
  }

  drawControls() {
    const { begin } = this.history;
    render(this.controls, replayControls(this, seconds(this.t - begin) + ' of '
      + seconds(this.end - begin)));
  }

  draw() {
    const { events, graph, images, replays } = this.trial;
    const now = this.history.at(Math.max(0, this.index));
    const event = events[Math.max(0, this.index)];
    const paths = [...new Set(events.map((each) => each.path))].filter(Boolean).sort();
    this.state = machineStateOf(now, paths, (path) => graph(path)?.oracle || 'ORACLE');
    const active = activePath(now);
    this.question.show(now.question, (now.question && images[now.question.query]) || []);
    this.lastSeconds.show(replays[now.failure]);
    const deepest = active.length ? active[active.length - 1][0] : event.path;
    const usual = graph(deepest) || !graph(event.path) ? deepest : event.path;
    this.path = paths.includes(this.chosen) ? this.chosen : usual;
    render(this.stage, this.stageView(active, now, paths));
    this.view.draw();
  }

  /**
   * @param {[path: string, label: string][]} active
   * @param {replay.Snapshot} now
   * @param {string[]} paths of containers
   */
  stageView(active, { failed }, paths) {
    return h('div', { class: 'replay-stage' }, h('div', { class: 'row replay-head' },
      h('div', { class: 'chips replay-path', 'aria-label': 'What is active' },
        active.map(([path, label], index) => [index > 0 && h('span', { class: 'dim' }, '›'),
          chip(label, failed[path] ? 'bad' : 'accent', path + '/' + label)]),
        !active.length && h('span', { class: 'dim' }, 'Nothing is active.')),
      h('span', { class: 'spacer' }),
      pick({ class: 'replay-container', 'aria-label': 'Machine that is shown', title: this.path,
        hidden: paths.length < 2 }, ['', ...paths].map((path) => [path, path || FOLLOW]),
      this.chosen, (path) => this.open(path))),
    keep(this.view.root));
  }

  /** @param {string} path of a container */
  open(path) {
    this.chosen = path;
    this.draw();
  }

  toggle() {
    if (this.playing) {
      this.stop();
      return;
    }
    if (!this.trial.events.length) return;
    if (this.t >= this.end - 1e-3) this.to(0);
    this.follow(false);
    this.showPlaying(true);
    let last = performance.now();
    /** @param {number} time ms */
    const frame = (time) => {
      if (!this.playing) return;
      this.playOn(Math.max(0, time - last) / 1000);
      last = time;
      if (this.playing) requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  }

  /** @param {number} passed s */
  playOn(passed) {
    if (this.root.isConnected) this.place(this.t + passed * this.speed);
    else this.stop();
    if (this.t >= this.end && !this.trial.running) this.stop();
  }

  stop() { this.showPlaying(false); }

  /** @param {boolean} playing */
  showPlaying(playing) {
    this.playing = playing;
    this.drawControls();
    this.words.setAttribute('aria-live', playing ? 'off' : 'polite');
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    /** @type {{ [key: string]: (() => void) | undefined }} */
    const acts = {
      ArrowLeft: () => this.step(-1),
      ArrowDown: () => this.step(-1),
      ArrowRight: () => this.step(1),
      ArrowUp: () => this.step(1),
      PageUp: () => this.step(1, true),
      PageDown: () => this.step(-1, true),
      Home: () => { this.stop(); this.to(0); },
      End: () => { this.stop(); this.to(this.last); },
      ' ': () => this.toggle(),
      '+': () => this.timeline.zoom(2),
      '-': () => this.timeline.zoom(0.5),
      0: () => this.timeline.zoom(0),
    };
    const act = acts[event.key];
    if (!act || modified(event)) return;
    event.preventDefault();
    event.stopPropagation();
    act();
  }

  /**
   * The same keys wherever in the replay one is, but where they mean something else.
   * @param {KeyboardEvent} event
   */
  keyOutside(event) {
    const { target } = event;
    if (!(target instanceof Element) || typing(target) || target.closest('.graph-frame')) return;
    if (event.key === ' ' && target.closest('button')) return;
    this.key(event);
  }
}

/** @param {server.TrialEvent} event */
function wordsOf(event) {
  return (event.words || event.kind) + (event.kind === 'failure' ? added(event) : '');
}

/** @param {number} number */
function seconds(number) {
  return '+' + (number < 100 ? number.toFixed(2) : number.toFixed(1)) + ' s';
}
