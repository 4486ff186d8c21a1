// @ts-check
// A camera, live: colour, or depth in false colours with its range.
import { h, setText } from '../page/dom.js';
import { drawImage, imageCanvas } from './image_canvas.js';
import { ImageAge } from './image_age.js';
import { SensorFeed, numberOf } from './sensor_feed.js';

export class CameraView {
  /**
   * @param {page.App} app
   * @param {string} topic
   * @param {string} [type]
   * @param {number} [width] px
   */
  constructor(app, topic, type, width = 640) {
    this.canvas = imageCanvas(topic);
    this.note = h('p', { class: 'view-note', role: 'status' }, 'Waiting for the first image…');
    this.range = h('span', { class: 'view-range' });
    this.age = new ImageAge();
    this.rate = h('span', { class: 'dim number' });
    this.root = h('figure', { class: 'view camera-view', 'data-topic': topic },
      h('div', { class: 'screen' }, this.canvas, this.note, this.range),
      h('figcaption', { class: 'row' }, h('span', { class: 'ellipsis' }, topic),
        h('span', { class: 'spacer' }), this.age.root, this.rate));
    /** @type {SensorFeed<server.ImageFacts>} */
    this.feed = new SensorFeed(app, () => numberOf(app, topic, type), this.root,
      { width, take: (answer, facts) => this.take(answer, facts), say: (text) => this.say(text) });
  }

  stop() {
    this.age.stop();
    this.feed.stop();
  }

  /** @param {string} text */
  say(text) {
    setText(this.note, text);
    this.root.classList.toggle('stale', Boolean(text));
    const { feed } = this; // none yet: it may say something as soon as it is made
    const width = feed && feed.link.isNarrow ? ', ' + feed.link.now + ' px (slow link)' : '';
    setText(this.rate, feed && feed.rate ? feed.rate.toFixed(1) + ' /s' + width : '');
  }

  /**
   * @param {Response} answer
   * @param {server.ImageFacts} facts
   */
  async take(answer, { range, age }) {
    await drawImage(this.canvas, answer);
    this.age.take(age);
    const [near, far] = (range || []).map((each) => each.toFixed(2) + ' m');
    setText(this.range, range ? 'red ' + near + ' … blue ' + far : '');
    this.root.classList.add('shown');
  }
}
