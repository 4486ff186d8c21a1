// @ts-check
// The sensors: all cameras, point clouds, robots and joint states that the server has found; up to
// four at a time.
import { h } from '../page/dom.js';
import { breakable } from '../page/format.js';
import { remember, remembered } from '../page/preferences.js';
import { redraw, redrawWith } from '../page/redraw.js';
import { SensorViews, nameOf } from './sensor_views.js';

/** @type {page.Panel} */
export const sensors = { id: 'sensors', title: 'Sensors', create: (app) => new SensorPanel(app) };

const MOST_VIEWS = 4;
/** @type {['image', 'cloud', 'robot', 'joints']} */
const KINDS = ['image', 'cloud', 'robot', 'joints'];
const TITLES = { image: 'Cameras', cloud: 'Point clouds', robot: 'Robots in 3D', joints: 'Joints' };
const NO_SENSORS = 'Cameras (Image, CompressedImage), point clouds (PointCloud2, or depth with its '
  + 'camera_info), robots (robot_description) and joint states appear here as soon as somebody '
  + 'publishes them.';
const CHOOSE = 'Choose up to ' + MOST_VIEWS + ' sensors. The console listens to a sensor only '
  + 'while somebody looks at it.';

class SensorPanel {
  /** @param {page.App} app */
  constructor(app) {
    this.app = app;
    this.views = new SensorViews(app, (sensor) => this.toggle(sensor));
    /** @type {server.Sensor[]} */
    this.looked = []; // those that are wanted, and were known
    this.list = h('aside', { class: 'picker sensor-list', 'aria-label': 'Sensors' });
    this.stage = h('div', { class: 'sensor-stage' });
    this.root = h('div', { class: 'panel sensors' }, this.list, this.stage);
    this.wanted = remembered('sensors', '').split('\n').filter(Boolean); // names
    this.draw();
  }

  get known() { return this.app.store.sensors; }

  get sections() { return /^sensors$/; }

  draw() {
    const { known } = this;
    if (!redrawWith(this.list, [known, this.wanted], () => (known.length ? KINDS.map((kind) => (
      this.group(TITLES[kind], known.filter((each) => each.kind === kind))))
      : h('p', { class: 'dim' }, 'No sensors yet.')))) return;
    this.looked = this.wanted.flatMap((name) => (
      [...known, ...this.looked].find((each) => nameOf(each) === name) || []));
    this.showStage();
  }

  /**
   * @param {string} title
   * @param {server.Sensor[]} found
   */
  group(title, found) {
    return found.length > 0 && h('div', { key: title, class: 'group' },
      h('span', { class: 'robot' }, title), found.map((sensor) => this.button(sensor)));
  }

  /** @param {server.Sensor} sensor */
  button(sensor) {
    const { topic, type } = sensor;
    const name = nameOf(sensor);
    return h('button', { key: name, class: 'path', title: topic + ', ' + type, 'data-topic': topic,
      'aria-pressed': this.wanted.includes(name), onclick: () => this.toggle(sensor) },
    breakable(topic.replace(/^\//, ''), '/'));
  }

  /** @param {server.Sensor} sensor */
  toggle(sensor) {
    const name = nameOf(sensor);
    this.wanted = this.wanted.includes(name) ? this.wanted.filter((each) => each !== name)
      : [...this.wanted, name].slice(-MOST_VIEWS);
    remember('sensors', this.wanted.join('\n'));
    this.draw();
  }

  showStage() {
    const views = this.views.of(this.looked);
    const any = this.known.length > 0;
    redraw(this.stage, views.length ? views : h('div', { class: 'empty' },
      h('h2', {}, any ? 'Nothing is looked at' : 'No sensors'),
      h('p', {}, any ? CHOOSE : NO_SENSORS)));
    this.stage.dataset['views'] = String(views.length);
  }
}
