// @ts-check
// A live camera beside the controls of a hand: the likeliest of the robot's own, or the one chosen.
// Cameras of others are shown to who chooses them, and never remembered.
import { h, replace } from '../page/dom.js';
import { remember, remembered } from '../page/preferences.js';
import { CameraView } from '../sensors/camera_view.js';

/** @typedef {import('../page/types').App} App */
/** @typedef {import('../server').Sensor} Sensor */

const WIDTH = 640; // px
const PREFERENCE = 'drive camera';
const NONE = 'No camera of its own';
const NOT_ITS_OWN = 'This camera is not known as the robot’s own.';

export class DriveCamera {
  /**
   * @param {App} app
   * @param {string} robot
   */
  constructor(app, robot) {
    this.app = app;
    this.robot = robot;
    /** @type {Sensor[]} */
    this.cameras = [];
    /** @type {string[]} */
    this.own = []; // topics
    this.key = ''; // of the cameras that are known
    /** @type {CameraView | null} */
    this.view = null;
    this.choice = h('select', { 'aria-label': 'Camera', onchange: () => {
      if (this.own.includes(this.choice.value)) remember(PREFERENCE, this.choice.value);
      this.show();
    } });
    this.root = h('div', { class: 'drive-camera' });
  }

  stop() { if (this.view) this.view.stop(); }

  update() {
    this.cameras = this.app.store.sensors.filter((each) => each.kind === 'image');
    const topics = this.cameras.map((each) => each.topic);
    this.own = (this.app.store.get('cameras')?.[this.robot] || [])
      .filter((topic) => topics.includes(topic));
    const key = JSON.stringify([topics, this.own]);
    if (key === this.key) return;
    this.key = key;
    const before = this.choice.value;
    const wanted = [before, remembered(PREFERENCE, '')].find((each) => this.own.includes(each));
    this.offer(topics, wanted || this.own[0] || (topics.includes(before) ? before : ''));
    this.show();
  }

  /**
   * @param {string[]} topics
   * @param {string} chosen
   */
  offer(topics, chosen) {
    const others = topics.filter((topic) => !this.own.includes(topic));
    /**
     * @param {string} value
     * @param {string} words
     */
    const option = (value, words) => h('option', { value, selected: value === chosen }, words);
    replace(this.choice, !this.own.length && option('', NONE),
      this.own.map((topic) => option(topic, topic)),
      others.map((topic) => option(topic, topic + ' (not its own)')));
  }

  show() {
    this.stop();
    const topic = this.choice.value;
    const camera = this.cameras.find((each) => each.topic === topic);
    this.view = camera ? new CameraView(this.app, camera.topic, camera.type, WIDTH) : null;
    const foreign = camera && !this.own.includes(topic);
    replace(this.root, (this.choice.options.length > 1 || !camera) && this.choice,
      foreign && h('p', { class: 'warn-note' }, NOT_ITS_OWN), this.view && this.view.root);
  }
}
