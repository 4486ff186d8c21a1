// @ts-check
// What is seen beside the controls of a hand: cameras side by side, and the robot in 3D. The
// likeliest of the robot's own cameras is there from the beginning. Views of others are shown to
// who chooses them, and never remembered.
import { h, pick } from '../page/dom.js';
import { breakable } from '../page/format.js';
import { remember, remembered } from '../page/preferences.js';
import { redraw } from '../page/redraw.js';
import { robotOf } from '../sensors/robot_feed.js';
import { SensorViews } from '../sensors/sensor_views.js';

const MOST = 3; // at a time
const PREFERENCE = 'drive views';
const NONE = 'No camera of its own';
const OTHERS = 'Show another camera…';
const NOT_ITS_OWN = 'Not known as a camera of this robot: ';
const IN_3D = 'Robot in 3D';

export class DriveViews {
  /**
   * @param {page.App} app
   * @param {string} robot
   */
  constructor(app, robot) {
    this.app = app;
    this.robot = robot;
    this.chosen = remembered(PREFERENCE, '').split('\n').filter(Boolean); // topics
    this.views = new SensorViews(app);
    this.root = h('div', { class: 'drive-views' });
  }

  stop() { this.views.of([]); }

  /** The cameras that are known as the robot's own, the likeliest one first, and the robot. */
  get own() {
    const { sensors } = this.app.store;
    const model = robotOf(this.app, this.robot + '/');
    return [...this.ownTopics.flatMap((topic) => this.cameras.find((each) => each.topic === topic)
      || []), ...sensors.filter(({ kind, topic }) => kind === 'robot' && topic === model)];
  }

  /** Cameras that are not. */
  get others() { return this.cameras.filter(({ topic }) => !this.ownTopics.includes(topic)); }

  get cameras() { return this.app.store.sensors.filter(({ kind }) => kind === 'image'); }

  get ownTopics() { return this.app.store.get('cameras')?.[this.robot] || []; }

  /** The sensors that are looked at, in the order in which they were chosen. */
  get looked() {
    const known = [...this.own, ...this.others];
    const found = this.chosen.flatMap((topic) => known.find((each) => each.topic === topic) || []);
    const first = this.own.find((each) => each.kind === 'image');
    return found.length || !first ? found : [first];
  }

  /** @param {string} topic that is looked at from now on, or no longer */
  turn(topic) {
    const before = this.looked.map((each) => each.topic);
    this.chosen = before.includes(topic) ? before.filter((each) => each !== topic)
      : [...before, topic].slice(-MOST);
    const own = this.own.map((each) => each.topic);
    remember(PREFERENCE, this.chosen.filter((each) => own.includes(each)).join('\n'));
    this.draw();
  }

  draw() {
    const { looked, own, others } = this;
    const topics = looked.map((each) => each.topic);
    const foreign = others.map((each) => each.topic).filter((each) => topics.includes(each));
    redraw(this.root, h('div', { class: 'row wrap' },
      h('div', { class: 'row wrap', role: 'group', 'aria-label': 'Views' }, own.length
        ? own.map((each) => this.button(each, topics.includes(each.topic)))
        : h('span', { class: 'dim' }, NONE)),
      pick({ 'aria-label': OTHERS, hidden: !others.length }, [['', OTHERS],
        ...others.map(({ topic }) => /** @type {[string, string]} */ (
          [topic, (topics.includes(topic) ? 'Close ' : '') + topic]))], '',
      (topic) => this.turn(topic))),
    h('p', { class: 'warn-note', hidden: !foreign.length }, NOT_ITS_OWN + foreign.join(', ')),
    h('div', { class: 'drive-stage' }, this.views.of(looked)));
  }

  /**
   * @param {server.Sensor} sensor
   * @param {boolean} isLookedAt
   */
  button({ kind, topic }, isLookedAt) {
    return h('button', { key: topic, class: 'tool', 'data-view': topic, 'aria-pressed': isLookedAt,
      onclick: () => this.turn(topic) },
    kind === 'robot' ? IN_3D : breakable(topic.replace(/^\//, ''), '/'));
  }
}
