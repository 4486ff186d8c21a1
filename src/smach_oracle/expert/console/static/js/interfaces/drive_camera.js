// @ts-check
// A live camera beside the controls of a hand: the first that gives colour, or the one chosen.
import { h, options, replace } from '../page/dom.js';
import { remember, remembered } from '../page/preferences.js';
import { CameraView } from '../sensors/camera_view.js';

/** @typedef {import('../page/types').App} App */
/** @typedef {import('../server').Sensor} Sensor */

const WIDTH = 640; // px
const PREFERENCE = 'drive camera';

export class DriveCamera {
  /** @param {App} app */
  constructor(app) {
    this.app = app;
    /** @type {Sensor[]} */
    this.cameras = [];
    this.key = ''; // of the cameras that are known
    /** @type {CameraView | null} */
    this.view = null;
    this.choice = h('select', { 'aria-label': 'Camera', onchange: () => {
      remember(PREFERENCE, this.choice.value);
      this.show();
    } });
    this.root = h('div', { class: 'drive-camera' });
  }

  stop() { if (this.view) this.view.stop(); }

  update() {
    this.cameras = this.app.store.sensors.filter((each) => each.kind === 'image');
    const topics = this.cameras.map((each) => each.topic);
    const key = topics.join(' ');
    if (key === this.key) return;
    this.key = key;
    const wanted = remembered(PREFERENCE, '');
    const colour = topics.find((topic) => !/depth/.test(topic));
    const chosen = topics.includes(wanted) ? wanted : colour || topics[0] || '';
    replace(this.choice, options(topics, chosen));
    this.show();
  }

  show() {
    this.stop();
    const camera = this.cameras.find((each) => each.topic === this.choice.value);
    this.view = camera ? new CameraView(this.app, camera.topic, camera.type, WIDTH) : null;
    replace(this.root, this.cameras.length > 1 && this.choice, this.view && this.view.root);
  }
}
