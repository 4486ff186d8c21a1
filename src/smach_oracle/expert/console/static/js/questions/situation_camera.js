// @ts-check
// The robot's cameras beside a question: what they gave at the failure, and live once somebody
// wants it. Side by side; on a phone one or the other.
import { h, pick } from '../page/dom.js';
import { keep, render } from '../page/redraw.js';
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
    /** @type {Pane} */
    this.pane = 'then'; // on a phone: which of the two is shown
    this.topic = '';
    /** @type {server.KeptImage[]} */
    this.images = []; // of the failure
    /** @type {{ id: number, root: HTMLElement } | null} */
    this.then = null;
    /** @type {{ topic: string, view: CameraView } | null} */
    this.now = null;
    this.root = h('section', {});
    this.draw();
  }

  draw() {
    const { store } = this.app;
    this.images = store.get('images')?.[this.question.key] || this.images;
    const topics = [...new Set([...this.images.map((image) => image.topic),
      ...(store.get('cameras')?.[this.question.robot] || [])])];
    if (!topics.includes(this.topic)) this.topic = topics[0] || '';
    if (!topics.length) this.live = false;
    const image = this.images.find((each) => each.topic === this.topic);
    if (this.then?.id !== image?.id) {
      this.then = image ? { id: image.id, root: new FailureImageView(this.app, image).root } : null;
    }
    this.watch(this.live ? this.topic : '');
    render(this.root, this.view(topics));
  }

  /** @param {string} topic '' for none */
  watch(topic) {
    if (topic === (this.now?.topic || '')) return;
    this.stop();
    this.now = topic ? { topic, view: new CameraView(this.app, topic) } : null;
  }

  /** @param {string[]} topics */
  view(topics) {
    const { live, then, now, pane } = this;
    const none = !topics.length;
    return h('section', { class: 'card situation-camera' + (none ? ' none' : '') },
      h('div', { class: 'row camera-head' }, h('h3', {}, 'Camera'),
        h('div', { class: 'row pane-tabs', role: 'group', 'aria-label': 'Which image' },
          this.tab('then', 'At the failure'), this.tab('now', 'Live')),
        h('span', { class: 'spacer' }),
        pick({ 'aria-label': 'Camera', hidden: topics.length < 2 },
          topics.map((topic) => [topic, topic]), this.topic, (topic) => {
            this.topic = topic;
            this.draw();
          }),
        h('button', { class: 'tool', type: 'button', 'data-action': 'live-camera', hidden: none,
          'aria-pressed': live, onclick: () => this.setLive(!this.live) },
        live ? 'Stop live' : 'Show live')),
      h('div', { class: 'panes' + (then && live ? '' : ' one'), 'data-shown': pane },
        h('div', { class: 'pane then', hidden: !then }, then && keep(then.root)),
        h('div', { class: 'pane now', hidden: Boolean(then) && !live }, now ? keep(now.view.root)
          : h('p', { class: 'dim' }, none ? NO_CAMERA : UNKNOWN))));
  }

  /**
   * @param {Pane} pane
   * @param {string} text
   */
  tab(pane, text) {
    return h('button', { class: 'tool', type: 'button', 'data-pane': pane,
      'aria-pressed': pane === this.pane, onclick: () => {
        this.pane = pane;
        this.setLive(this.live || pane === 'now');
      } }, text);
  }

  /** @param {boolean} on */
  setLive(on) {
    this.live = on;
    this.draw();
  }

  stop() { this.now?.view.stop(); }
}
