// @ts-check
// The last seconds before a failure, beside its question: images frame by frame, what happened, and
// the joints that moved most. Images come once somebody looks for more than the last one.
import { h, replace, say, setText } from '../page/dom.js';
import { redraw } from '../page/redraw.js';
import { drawImage, imageCanvas } from '../sensors/image_canvas.js';
import { HUES, JointPlot } from '../sensors/joint_plot.js';
import { playButton, showPlaying } from '../sensors/play_buttons.js';

const STEP_S = 0.1;
const CALM_MS = 1000; // from image to image, for those who want little motion
const LANDMARKS = new Set(['failure', 'warning', 'give_up', 'preempt']);
const GONE = 'It is not kept any more.';

/**
 * Index of the last item at or before a moment, -1 where there is none.
 * @param {{ t: number }[]} items by time
 * @param {number} t
 */
export function latestAt(items, t) {
  let found = -1;
  items.forEach((each, index) => { if (each.t <= t + 1e-6) found = index; });
  return found;
}

/**
 * How far back there is anything, in whole seconds.
 * @param {server.Replay} replay
 */
export function lengthOf({ seconds, frames, events, joints }) {
  const times = [...frames.map(([, t]) => t), ...events.map(({ t }) => t),
    ...joints.flatMap(({ samples }) => samples.map(([t]) => t))];
  return Math.ceil(Math.min(seconds, Math.max(1, ...times.map((t) => -t))));
}

export class LastSeconds {
  /**
   * @param {page.App} app
   * @param {string} question its key
   */
  constructor(app, question) {
    this.app = app;
    this.question = question;
    this.number = 0; // of the replay, 0 for none
    /** @type {server.Replay} */
    this.replay = { seconds: 1, cameras: [], frames: [], events: [], joints: [] };
    /** @type {{ t: number, index: number }[]} */
    this.frames = []; // of the chosen camera
    /** @type {Map<number, Blob | string>} */
    this.images = new Map(); // by frame; a text: why there is none
    this.length = 1; // s, of the time line
    this.t = 0; // s after the failure, so never above 0
    this.timer = 0; // 0 while it does not play
    this.loading = false;
    this.drawn = Promise.resolve(); // images are drawn one after the other
    this.choice = h('select', { 'aria-label': 'Camera of the replay',
      onchange: () => this.chooseCamera() });
    this.canvas = imageCanvas('the camera', ' before the failure');
    this.note = h('p', { class: 'view-note', role: 'status' });
    this.screen = h('div', { class: 'screen' }, this.canvas, this.note);
    this.marks = h('div', { class: 'last-marks', 'aria-hidden': 'true' });
    this.slider = h('input', { type: 'range', max: 0, step: STEP_S, 'data-replay': 'scrubber',
      'aria-label': 'Time before the failure', oninput: () => this.seek(Number(this.slider.value)),
      onkeydown: (event) => this.key(event) });
    this.playButton = playButton('▶', 'Play', 'play', () => this.toggle());
    this.time = h('span', { class: 'number last-time' });
    this.words = h('p', { class: 'last-words' });
    this.plot = new JointPlot();
    this.legend = h('p', { class: 'plot-legend' });
    this.joints = h('div', { class: 'last-joints' }, this.plot.canvas, this.legend);
    this.resized = new ResizeObserver(() => this.showJoints());
    this.resized.observe(this.joints);
    this.title = h('h3', {});
    this.root = this.build();
    this.update();
  }

  build() {
    return h('section', { class: 'card last-seconds', hidden: true },
      h('div', { class: 'row last-head' }, this.title, h('span', { class: 'spacer' }), this.choice),
      h('div', { class: 'last-stage' }, this.screen, this.joints), this.marks, this.slider,
      h('div', { class: 'row last-controls', role: 'group', 'aria-label': 'Replay' },
        playButton('|◂', 'To the beginning', 'first', () => this.seek(-this.length)),
        playButton('◂', 'One image back', 'back', () => this.step(-1)), this.playButton,
        playButton('▸', 'One image on', 'on', () => this.step(1)),
        playButton('▸|', 'To the failure', 'last', () => this.seek(0)),
        h('span', { class: 'spacer' }), this.time),
      this.words);
  }

  /** Show what has come. What is shown stays where the question is open no longer. */
  update() {
    if (!this.root.hidden) this.showJoints(); // in the colours of now
    const number = this.app.store.get('replays')?.[this.question];
    if (!number || number === this.number) return;
    this.number = number;
    this.fetch();
  }

  async fetch() {
    const { number } = this;
    const answer = await this.app.connection.fetch('replay/' + number).catch(() => null);
    if (number !== this.number) return;
    if (answer?.ok) this.set(await answer.json());
    else this.number = 0; // it is tried again with the next change
  }

  /** @param {server.Replay} replay */
  set(replay) {
    this.stop();
    this.replay = replay;
    this.images.clear();
    this.length = lengthOf(replay);
    setText(this.title, 'Last ' + this.length + ' s before the failure');
    this.slider.min = String(-this.length);
    const seen = replay.cameras.filter((_, camera) => replay.frames.some(([each]) => (
      each === camera)));
    redraw(this.choice, seen.map((camera) => h('option', { key: camera }, camera)));
    this.choice.hidden = seen.length < 2;
    this.screen.hidden = !seen.length;
    this.joints.hidden = !replay.joints.length;
    replace(this.legend, replay.joints.map(({ name }, index) => (
      h('span', { class: 'series', '--hue': HUES[index] }, name))));
    replace(this.marks, replay.events.map(({ t, kind }) => (
      h('i', { class: LANDMARKS.has(kind) ? 'landmark' : '', '--at': this.share(t) }))));
    this.root.hidden = false;
    this.t = 0;
    this.chooseCamera();
  }

  /**
   * Where a moment is on the time line, from 0 to 1.
   * @param {number} t
   */
  share(t) { return 1 + Math.max(-1, t / this.length); }

  chooseCamera() {
    const camera = this.replay.cameras.indexOf(this.choice.value);
    this.frames = this.replay.frames.map(([each, t], index) => ({ each, t, index }))
      .filter(({ each }) => each === camera);
    this.show();
  }

  /** @param {number} t */
  seek(t) {
    this.stop();
    this.place(t);
    this.load();
  }

  /** @param {number} t */
  place(t) {
    this.t = Math.min(0, Math.max(-this.length, t));
    this.show();
  }

  /** The moments at which something is to be seen. */
  get stops() { return this.frames.length ? this.frames : this.replay.events; }

  /** @param {1 | -1} by an image; where there are none, an event */
  step(by) {
    const { stops } = this;
    const next = stops[Math.max(0, latestAt(stops, this.t)) + by];
    this.seek(next ? next.t : by < 0 ? -this.length : 0);
  }

  toggle() {
    if (this.timer) {
      this.stop();
      return;
    }
    if (this.t > -STEP_S) this.place(this.stops.length ? this.stops[0].t : -this.length);
    const calm = matchMedia('(prefers-reduced-motion: reduce)').matches;
    this.timer = window.setInterval(() => this.playOn(calm), calm ? CALM_MS : STEP_S * 1000);
    showPlaying(this.playButton, Boolean(this.timer));
    this.load();
  }

  /** @param {boolean} calm from image to image */
  playOn(calm) {
    if (!this.root.isConnected) {
      this.stop();
      return;
    }
    const next = this.stops[latestAt(this.stops, this.t) + 1];
    this.place(calm ? (next ? next.t : 0) : this.t + STEP_S);
    if (this.t >= 0) this.stop();
  }

  stop() {
    clearInterval(this.timer);
    this.timer = 0;
    showPlaying(this.playButton, Boolean(this.timer));
  }

  /** It is shown no longer. */
  end() {
    this.stop();
    this.resized.disconnect();
  }

  /** @param {KeyboardEvent} event on the time line, where arrows move as on any slider */
  key(event) {
    if (event.key !== ' ') return;
    event.preventDefault();
    event.stopPropagation();
    this.toggle();
  }

  show() {
    const { t, replay } = this;
    const event = replay.events[latestAt(replay.events, t)];
    const when = t > -STEP_S / 2 ? 'at the failure' : (-t).toFixed(1) + ' s before the failure';
    this.slider.value = String(t);
    this.slider.setAttribute('aria-valuetext', when);
    setText(this.time, when);
    setText(this.words, event ? event.words : '');
    this.showJoints();
    this.showImage();
  }

  showJoints() {
    this.joints.style.setProperty('--at', String(this.share(this.t)));
    this.plot.draw(this.replay.joints.map(({ samples }) => samples), 0, this.length);
  }

  /** The frame of the moment that is shown. */
  get frame() { return this.frames[Math.max(0, latestAt(this.frames, this.t))]; }

  showImage() {
    const { frame } = this;
    if (!frame) return;
    this.canvas.setAttribute('aria-label', 'Image of ' + this.choice.value + ', '
      + (-frame.t).toFixed(1) + ' s before the failure');
    const image = this.images.get(frame.index);
    if (image === undefined) {
      if (!this.loading) this.load(1);
      return;
    }
    say(this.note, typeof image === 'string' ? image : '');
    if (image instanceof Blob) this.drawn = this.drawn.then(() => this.draw(frame.index, image));
  }

  /**
   * @param {number} frame
   * @param {Blob} image
   */
  async draw(frame, image) {
    if (this.frame?.index !== frame) return; // another one is wanted meanwhile
    await drawImage(this.canvas, new Response(image)).catch(() => {}); // the next may be sound
    this.canvas.dataset['frame'] = String(frame);
  }

  /** @param {number} [most] images, those nearest to the moment that is shown first */
  async load(most = Infinity) {
    if (this.loading) return;
    this.loading = true;
    const { number } = this;
    for (let count = 0; count < most || !this.hasShown; count += 1) {
      const next = this.nextMissing();
      if (next === null || number !== this.number) break;
      const image = await this.fetchImage(number, next);
      if (image === null) break; // the connection is away: whoever moves on asks again
      this.images.set(next, image);
      this.showImage();
    }
    this.loading = false;
  }

  /** Whether the image of this moment is there. */
  get hasShown() {
    return !this.frame || this.images.has(this.frame.index);
  }

  nextMissing() {
    const shown = Math.max(0, latestAt(this.frames, this.t));
    const missing = this.frames.map(({ index }, place) => ({ index, far: Math.abs(place - shown) }))
      .filter(({ index }) => !this.images.has(index)).sort((one, other) => one.far - other.far);
    return missing.length ? missing[0].index : null;
  }

  /**
   * @param {number} replay
   * @param {number} frame
   * @returns {Promise<Blob | string | null>}
   */
  async fetchImage(replay, frame) {
    try {
      const answer = await this.app.connection.fetch('replay/' + replay + '/' + frame);
      if (answer.ok) return await answer.blob();
      return answer.status === 404 ? GONE : answer.status === 422 ? await answer.text() : null;
    } catch {
      return null;
    }
  }
}
