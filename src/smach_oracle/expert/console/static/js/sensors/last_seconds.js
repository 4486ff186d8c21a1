// @ts-check
// The last seconds before a failure: images frame by frame, what happened, and the joints that
// moved most. Images come once somebody looks for more than the last one.
import { h, pick, setText } from '../page/dom.js';
import { keep, render } from '../page/redraw.js';
import { drawImage, imageCanvas } from './image_canvas.js';
import { JointPlot, legendOf } from './joint_plot.js';
import { playButton, playOrPause } from './play_buttons.js';

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
  /** @param {page.App} app */
  constructor(app) {
    this.app = app;
    this.number = 0; // of the replay, 0 for none
    /** @type {server.Replay} */
    this.replay = { seconds: 1, cameras: [], frames: [], events: [], joints: [] };
    this.camera = ''; // that is shown
    /** @type {{ t: number, index: number }[]} */
    this.frames = []; // of that camera
    /** @type {Map<number, Blob | string>} */
    this.images = new Map(); // by frame; a text: why there is none
    this.length = 0; // s, of the time line; 0: nothing has come yet
    this.t = 0; // s after the failure, so never above 0
    this.timer = 0; // 0 while it does not play
    this.loading = false;
    this.drawn = Promise.resolve(); // images are drawn one after the other
    this.canvas = imageCanvas('the camera', ' before the failure');
    this.note = h('p', { class: 'view-note', role: 'status' });
    this.screen = h('div', { class: 'screen' }, this.canvas, this.note);
    this.slider = h('input', { type: 'range', max: 0, step: STEP_S, 'data-replay': 'scrubber',
      'aria-label': 'Time before the failure', oninput: () => this.seek(Number(this.slider.value)),
      onkeydown: (event) => this.key(event) });
    this.plot = new JointPlot();
    this.resized = new ResizeObserver(() => this.drawPlot());
    this.resized.observe(this.plot.canvas);
    this.root = h('section', { class: 'card last-seconds', hidden: true });
  }

  /** @param {string} when */
  view(when) {
    const { replay: { events, joints }, t } = this;
    return h('section', { class: 'card last-seconds' },
      h('div', { class: 'row last-head' },
        h('h3', {}, 'Last ' + this.length + ' s before the failure'),
        h('span', { class: 'spacer' }),
        pick({ 'aria-label': 'Camera of the replay', hidden: this.seen.length < 2 },
          this.seen.map((each) => [each, each]), this.camera, (each) => this.chooseCamera(each))),
      h('div', { class: 'last-stage' }, keep(this.screen),
        h('div', { class: 'last-joints', hidden: !joints.length, '--at': this.share(t) },
          keep(this.plot.canvas), legendOf(joints.map(({ name }) => name)))),
      h('div', { class: 'last-marks', 'aria-hidden': 'true' }, events.map((event) => h('i', {
        class: LANDMARKS.has(event.kind) ? 'landmark' : '', '--at': this.share(event.t) }))),
      keep(this.slider),
      h('div', { class: 'row last-controls', role: 'group', 'aria-label': 'Replay' },
        playButton('|◂', 'To the beginning', 'first', () => this.seek(-this.length)),
        playButton('◂', 'One image back', 'back', () => this.step(-1)),
        playOrPause(this.timer > 0, () => this.toggle()),
        playButton('▸', 'One image on', 'on', () => this.step(1)),
        playButton('▸|', 'To the failure', 'last', () => this.seek(0)),
        h('span', { class: 'spacer' }), h('span', { class: 'number last-time' }, when)),
      h('p', { class: 'last-words' }, events[latestAt(events, t)]?.words));
  }

  /** The cameras that gave an image. */
  get seen() {
    const { cameras, frames } = this.replay;
    return cameras.filter((_, camera) => frames.some(([each]) => each === camera));
  }

  /**
   * Show a replay, or none.
   * @param {number | undefined} number
   */
  show(number = 0) {
    if (number === this.number) {
      if (this.length) this.drawPlot(); // in the colours of now
      return;
    }
    this.number = number;
    this.length = 0; // what was shown is of something else
    this.stop();
    this.root.hidden = true;
    if (number) this.fetch();
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
    this.t = 0;
    this.slider.min = String(-this.length);
    this.screen.hidden = !this.seen.length;
    this.chooseCamera(this.seen.includes(this.camera) ? this.camera : this.seen[0] || '');
  }

  /**
   * Where a moment is on the time line, from 0 to 1.
   * @param {number} t
   */
  share(t) { return 1 + Math.max(-1, t / this.length); }

  /** @param {string} camera */
  chooseCamera(camera) {
    const wanted = this.replay.cameras.indexOf(camera);
    this.camera = camera;
    this.frames = this.replay.frames.map(([each, t], index) => ({ each, t, index }))
      .filter(({ each }) => each === wanted);
    this.draw();
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
    this.draw();
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
    this.draw();
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
    if (this.length) this.draw();
  }

  /** It is shown no longer. */
  end() {
    clearInterval(this.timer);
    this.resized.disconnect();
  }

  /** @param {KeyboardEvent} event on the time line, where arrows move as on any slider */
  key(event) {
    if (event.key !== ' ') return;
    event.preventDefault();
    event.stopPropagation();
    this.toggle();
  }

  draw() {
    const { t } = this;
    const when = t > -STEP_S / 2 ? 'at the failure' : (-t).toFixed(1) + ' s before the failure';
    this.slider.value = String(t);
    this.slider.setAttribute('aria-valuetext', when);
    render(this.root, this.view(when));
    this.drawPlot();
    this.showImage();
  }

  drawPlot() { this.plot.draw(this.replay.joints.map(({ samples }) => samples), 0, this.length); }

  /** The frame of the moment that is shown. */
  get frame() { return this.frames[Math.max(0, latestAt(this.frames, this.t))]; }

  showImage() {
    const { frame } = this;
    if (!frame) return;
    this.canvas.setAttribute('aria-label', 'Image of ' + this.camera + ', '
      + (-frame.t).toFixed(1) + ' s before the failure');
    const image = this.images.get(frame.index);
    if (image === undefined) {
      if (!this.loading) this.load(1);
      return;
    }
    setText(this.note, typeof image === 'string' ? image : '');
    if (image instanceof Blob) {
      this.drawn = this.drawn.then(() => this.drawFrame(frame.index, image));
    }
  }

  /**
   * @param {number} frame
   * @param {Blob} image
   */
  async drawFrame(frame, image) {
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
      if (next === null) break;
      const image = await this.fetchImage(number, next);
      // null: the connection is away, and whoever moves on asks again
      if (image === null || number !== this.number) break;
      this.images.set(next, image);
      this.showImage();
    }
    this.loading = false;
    if (number !== this.number) this.showImage(); // of another replay meanwhile
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
