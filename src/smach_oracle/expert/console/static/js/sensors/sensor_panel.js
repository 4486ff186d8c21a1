// @ts-check
// The sensors: all cameras, point clouds, robots and joint states that the server has found; up to
// four at a time.
import { h } from '../page/dom.js';
import { breakable } from '../page/format.js';
import { remember, remembered } from '../page/preferences.js';
import { keep, redraw, redrawWith } from '../page/redraw.js';
import { CameraView } from './camera_view.js';
import { CloudView } from './cloud_view.js';
import { JointsView } from './joints_view.js';
import { RobotView } from './robot_view.js';

/** @typedef {{ root: HTMLElement, stop(): void }} View */

/** @type {page.Panel} */
export const sensors = { id: 'sensors', title: 'Sensors', create: (app) => new SensorPanel(app) };

const MOST_VIEWS = 4;
/** @type {['image', 'cloud', 'robot', 'joints']} */
const KINDS = ['image', 'cloud', 'robot', 'joints'];
const TITLES = { image: 'Cameras', cloud: 'Point clouds', robot: 'Robots in 3D', joints: 'Joints' };
const VIEWS = { image: CameraView, cloud: CloudView, robot: RobotView, joints: JointsView };
const NO_SENSORS = 'Cameras (Image, CompressedImage), point clouds (PointCloud2, or depth with its '
  + 'camera_info), robots (robot_description) and joint states appear here as soon as somebody '
  + 'publishes them.';
const CHOOSE = 'Choose up to ' + MOST_VIEWS + ' sensors. The console listens to a sensor only '
  + 'while somebody looks at it.';

class SensorPanel {
  /** @param {page.App} app */
  constructor(app) {
    this.app = app;
    /** @type {Map<string, View>} */
    this.views = new Map(); // by name
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
    for (const sensor of known) {
      const name = nameOf(sensor);
      if (this.wanted.includes(name) && !this.views.has(name)) this.open(sensor);
    }
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
    if (this.wanted.includes(name)) {
      this.close(name);
    } else {
      this.wanted.push(name);
      while (this.wanted.length > MOST_VIEWS) this.close(this.wanted[0]);
    }
    remember('sensors', this.wanted.join('\n'));
    this.draw();
  }

  /** @param {server.Sensor} sensor */
  open(sensor) {
    const { topic, type, kind } = sensor;
    const view = new VIEWS[kind](this.app, topic, type);
    view.root.append(h('button', { class: 'tool view-close', 'aria-label': 'Close ' + topic,
      onclick: () => this.toggle(sensor) }, '×'));
    this.views.set(nameOf(sensor), view);
  }

  /** @param {string} name */
  close(name) {
    this.wanted = this.wanted.filter((each) => each !== name);
    this.views.get(name)?.stop();
    this.views.delete(name);
  }

  showStage() {
    const roots = [...this.views.values()].map((view) => keep(view.root));
    const any = this.known.length > 0;
    redraw(this.stage, roots.length ? roots : h('div', { class: 'empty' },
      h('h2', {}, any ? 'Nothing is looked at' : 'No sensors'),
      h('p', {}, any ? CHOOSE : NO_SENSORS)));
    this.stage.dataset['views'] = String(roots.length);
  }
}

/** @param {server.Sensor} sensor */
function nameOf({ type, topic }) { return type + ' ' + topic; }
