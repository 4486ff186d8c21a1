// @ts-check
// The robot's cameras beside a question: what they gave at the failure, and live once somebody
// wants it. Side by side; on a phone one or the other.
import { h, options, replace, setText } from '../page/dom.js';
import { CameraView } from '../sensors/camera_view.js';
import { FailureImageView } from '../sensors/failure_image_view.js';

/** @typedef {'then' | 'now'} Pane */

const UNKNOWN = 'What it saw at the failure is not known.';
export const NO_CAMERA = 'No camera of its own. The console’s setting ~cameras names one; the tab '
  + 'Sensors shows all there are.';

export class SituationCamera {
  /**
   * @param {page.App} app
   * @param {server.Question} question
   */
  constructor(app, question) {
    this.app = app;
    this.question = question;
    this.live = false;
    /** @type {server.KeptImage[]} */
    this.images = []; // of the failure
    /** @type {number | null} */
    this.shownImage = null;
    this.shape = ''; // of what there is to choose from
    this.topic = ''; // of the live view
    /** @type {CameraView | null} */
    this.view = null;
    this.choice = h('select', { 'aria-label': 'Camera', onchange: () => this.look() });
    this.then = h('div', { class: 'pane then' });
    this.now = h('div', { class: 'pane now' });
    this.tabs = [this.tab('then', 'At the failure'), this.tab('now', 'Live')];
    this.toggle = h('button', { class: 'tool', type: 'button', 'data-action': 'live-camera',
      onclick: () => this.setLive(!this.live) });
    this.panes = h('div', { class: 'panes' }, this.then, this.now);
    this.root = h('section', { class: 'card situation-camera' },
      h('div', { class: 'row camera-head' }, h('h3', {}, 'Camera'),
        h('div', { class: 'row pane-tabs', role: 'group', 'aria-label': 'Which image' }, this.tabs),
        h('span', { class: 'spacer' }), this.choice, this.toggle), this.panes);
    this.turn('then');
    this.update();
  }

  /**
   * @param {Pane} pane
   * @param {string} text
   */
  tab(pane, text) {
    return h('button', { class: 'tool', type: 'button', 'data-pane': pane,
      onclick: () => this.turn(pane) }, text);
  }

  update() {
    this.images = this.app.store.get('images')?.[this.question.key] || this.images;
    const topics = [...new Set([...this.images.map((image) => image.topic),
      ...(this.app.store.get('cameras')?.[this.question.robot] || [])])];
    const shape = JSON.stringify([topics, this.images]);
    if (shape === this.shape) return;
    this.shape = shape;
    replace(this.choice, options(topics, this.choice.value));
    this.choice.hidden = topics.length < 2;
    this.root.classList.toggle('none', !topics.length);
    if (!topics.length) this.live = false;
    this.toggle.hidden = !topics.length;
    this.look();
  }

  /**
   * On a phone: which of the two is shown.
   * @param {Pane} pane
   */
  turn(pane) {
    this.panes.dataset['shown'] = pane;
    for (const tab of this.tabs) {
      tab.setAttribute('aria-pressed', String(tab.dataset['pane'] === pane));
    }
    if (pane === 'now') this.setLive(true);
  }

  /** @param {boolean} on */
  setLive(on) {
    this.live = on;
    this.look();
  }

  look() {
    const topic = this.choice.value;
    const image = this.images.find((each) => each.topic === topic);
    this.panes.classList.toggle('one', !image || !this.live);
    this.showImage(image);
    this.then.hidden = !image;
    this.now.hidden = Boolean(image) && !this.live;
    setText(this.toggle, this.live ? 'Stop live' : 'Show live');
    this.toggle.setAttribute('aria-pressed', String(this.live));
    this.showLive(this.live ? topic : '');
    if (!topic || (!image && !this.live)) {
      replace(this.now, h('p', { class: 'dim' }, topic ? UNKNOWN : NO_CAMERA));
    }
  }

  /** @param {server.KeptImage | undefined} image */
  showImage(image) {
    const id = image ? image.id : null;
    if (id === this.shownImage) return;
    this.shownImage = id;
    replace(this.then, image && new FailureImageView(this.app, image).root);
  }

  /** @param {string} topic '' for none */
  showLive(topic) {
    if (topic === this.topic) return;
    this.topic = topic;
    this.stop();
    this.view = topic ? new CameraView(this.app, topic) : null;
    replace(this.now, this.view && this.view.root);
  }

  stop() { if (this.view) this.view.stop(); }
}
