// A point cloud and a robot in one picture, live: either of them may be chosen first, the other joins it.
import { h, replace, setText } from './dom.js';
import { FrameFeed, numberOf } from './frame_feed.js';
import { ROBOT, RobotFeed, robotOf, robotsOf } from './robot_feed.js';
import { CloudLayer, GridLayer, unpacked } from './scene_layers.js';
import { SceneView } from './scene_view.js';

class LiveScene {
  constructor(app, label) {
    this.app = app;
    this.scene = new SceneView(label, () => this.home());
    this.choice = h('select', { class: 'beside' });
    this.choice.addEventListener('change', () => this.choose(this.choice.value));
    this.count = h('span', { class: 'dim number' });
    this.lack = h('p', { class: 'view-lack dim', hidden: true });
    this.root = h('figure', { class: 'view cloud-view', 'data-topic': label }, this.scene.root,
      h('figcaption', {}, h('div', { class: 'row' }, h('span', { class: 'ellipsis' }, label), h('span', { class: 'spacer' }), this.count, this.choice), this.lack));
    this.clouds = null;
    this.robot = null;
  }

  begin() {
    this.offer();
    this.offering = setInterval(() => this.offer(), 1000);
  }

  stop() {
    clearInterval(this.offering);
    this.scene.stop();
    for (const feed of [this.clouds, this.robot]) if (feed) feed.stop();
  }

  // What else may be shown; `none` says so where nothing is.
  offerOf(names, chosen, none) {
    const shape = names.join('\n');
    if (shape === this.offered) return;
    this.offered = shape;
    replace(this.choice, h('option', { value: '' }, none), names.map((name) => h('option', { value: name, selected: name === chosen }, this.nameOf(name))));
    this.choice.hidden = !names.length;
    this.choose(this.choice.value);
  }

  startRobot(topic) {
    if (this.robot) this.robot.stop();
    this.robot = topic ? new RobotFeed(this.app, topic, this.root, { moved: () => this.changed(), say: (text) => this.sayOf('robot', text) }) : null;
    this.sayOf('robot', '');
    this.changed();
  }

  startClouds(topic, type) {
    if (this.clouds) this.clouds.stop();
    this.cloud = null;
    this.clouds = topic ? new FrameFeed(this.app, () => numberOf(this.app, topic, type), this.root, { every: 150, beside: () => (this.robot ? this.robot.number : undefined),
      take: (answer, facts) => this.takeCloud(answer, facts), say: (text) => this.sayOf('cloud', text) }) : null;
    this.sayOf('cloud', topic ? 'Waiting for the first cloud…' : '');
    this.changed();
  }

  async takeCloud(answer, facts) {
    const data = unpacked(await answer.arrayBuffer(), facts);
    this.facts = facts;
    this.cloud = new CloudLayer(data, facts.place);
    setText(this.count, facts.count < facts.of ? facts.count + ' of ' + facts.of + ' points' : facts.count + ' points');
    this.changed();
  }

  get robotLayer() {
    const layer = this.robot && this.robot.layer;
    return layer && (!this.cloud || this.facts.place) ? layer : null; // both only where they have a place at each other
  }

  changed() {
    const robot = this.robotLayer;
    this.scene.show([robot && new GridLayer(this.robot.floor), this.cloud, robot]);
    const shape = [Boolean(robot), Boolean(this.cloud), this.cloud && Boolean(this.facts.place)].join();
    if (shape !== this.shape && (robot || this.cloud)) this.home();
    this.shape = shape;
    this.tellLack();
  }

  // As the sensor sees it where there is no robot: optical frames look along z with y down, others along x with z up.
  home() {
    const robot = this.robotLayer;
    const near = this.cloud && robot ? around(this.cloud.bounds(), robot.bounds()) : null;
    const optical = Boolean(this.cloud && !this.facts.place && /optical|^$/.test(this.facts.frame));
    this.scene.frame(near ? [{ bounds: () => near }] : [this.cloud, robot], robot ? { optical, azimuth: -1.15, elevation: 0.35, reach: near ? 0.9 : 1.25 } : { optical });
  }

  // In the middle of the picture as long as there is none, below it from then on.
  sayOf(what, text) {
    const told = what === 'robot' && /^Nothing/.test(text) ? 'No joint states come.' : text;
    this.said = Object.assign({}, this.said, { [what]: told });
    this.tellLack();
  }

  tellLack() {
    const { cloud = '', robot = '' } = this.said || {};
    const lacks = this.robot ? this.robot.lacks : '';
    const something = this.cloud || this.robotLayer;
    this.scene.say(something ? '' : cloud || robot);
    const text = something ? [this.cloud && this.robot && this.facts.astray, cloud, lacks ? '' : robot, lacks].filter(Boolean).join(' ') : '';
    setText(this.lack, text);
    this.lack.hidden = !text;
  }
}

export class CloudView extends LiveScene {
  constructor(app, topic, type) {
    super(app, topic);
    this.topic = topic;
    this.choice.setAttribute('aria-label', 'Robot in the picture');
    this.startClouds(topic, type);
    this.begin();
  }

  offer() { this.offerOf(robotsOf(this.app), robotOf(this.app, this.topic), 'no robot'); }

  nameOf(topic) { return ['with robot', topic.slice(1, -ROBOT.length - 1)].filter(Boolean).join(' '); }

  choose(topic) { this.startRobot(topic); }
}

export class RobotView extends LiveScene {
  constructor(app, topic) {
    super(app, topic);
    this.choice.setAttribute('aria-label', 'Point cloud in the picture');
    this.startRobot(topic);
    this.begin();
  }

  get found() { return ((this.app.store.get('eye') || {}).sensors || []).filter((each) => each.kind === 'cloud'); }

  offer() { this.offerOf(this.found.map((each) => each.topic), this.choice.value, 'no point cloud'); }

  nameOf(topic) { return 'with ' + topic.replace(/^\//, ''); }

  choose(topic) {
    const cloud = this.found.find((each) => each.topic === topic);
    this.startClouds(topic, cloud && cloud.type);
    if (!topic) setText(this.count, '');
  }
}

// The robot, and what the cloud has within 1.2 m of it.
function around(cloud, robot) {
  if (!cloud || !robot) return cloud || robot;
  const near = (value, axis) => Math.min(robot[1][axis] + 1.2, Math.max(robot[0][axis] - 1.2, value));
  return [Math.min, Math.max].map((most, end) => [0, 1, 2].map((axis) => most(near(cloud[end][axis], axis), robot[end][axis])));
}
