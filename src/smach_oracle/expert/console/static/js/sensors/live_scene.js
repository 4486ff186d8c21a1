// @ts-check
// A point cloud and a robot in one scene, live: either may be chosen first, the other joins it.
import { CloudLayer, unpacked } from '../drawing/cloud_layer.js';
import { GridLayer } from '../drawing/grid_layer.js';
import { SceneView } from '../drawing/scene_view.js';
import { boxAround, vector } from '../drawing/transforms.js';
import { h, pick, setText } from '../page/dom.js';
import { renderWith } from '../page/redraw.js';
import { ROBOT, RobotFeed, robotOf } from './robot_feed.js';
import { SensorFeed, numberOf } from './sensor_feed.js';

const PERIOD_MS = 150;
const OFFER_MS = 1000; // how often it is looked for what else may be shown
const NO_JOINTS = 'No joint states come.';
const NEAR = 1.2; // m: what of a cloud is near a robot

export class LiveScene {
  /**
   * @param {page.App} app
   * @param {string} topic
   * @param {string} type
   */
  constructor(app, topic, type) {
    this.app = app;
    this.topic = topic;
    this.ofRobot = type === ROBOT; // which a cloud may join; else a cloud, which a robot may join
    this.scene = new SceneView(topic, () => this.home());
    this.choice = h('select', {});
    this.count = h('span', { class: 'dim number' });
    this.lack = h('p', { class: 'view-lack dim' });
    this.root = h('figure', { class: 'view cloud-view', 'data-topic': topic }, this.scene.root,
      h('figcaption', {}, h('div', { class: 'row' }, h('span', { class: 'ellipsis' }, topic),
        h('span', { class: 'spacer' }), this.count, this.choice), this.lack));
    /** @type {SensorFeed<server.CloudFacts> | null} */
    this.clouds = null;
    /** @type {RobotFeed | null} */
    this.robot = null;
    /** @type {{ layer: CloudLayer, facts: server.CloudFacts } | null} */
    this.cloud = null;
    this.said = { cloud: '', robot: '' }; // what the feeds say
    /** @type {string | null} */
    this.wanted = null; // the topic beside it that a person has chosen; null: nobody has
    this.beside = ''; // the one that is shown
    this.shape = ''; // what is there
    if (this.ofRobot) this.startRobot(topic);
    else this.startClouds(topic, type);
    this.offer();
    this.offering = setInterval(() => this.offer(), OFFER_MS);
  }

  stop() {
    clearInterval(this.offering);
    this.scene.stop();
    for (const feed of [this.clouds, this.robot]) feed?.stop();
  }

  /** Offer what else there is to be shown. A cloud has its robot beside it from the beginning. */
  offer() {
    const { app, ofRobot } = this;
    const others = app.store.sensors.filter(({ kind }) => kind === (ofRobot ? 'cloud' : 'robot'));
    const wanted = this.wanted ?? (ofRobot ? '' : robotOf(app, this.topic));
    const found = others.find(({ topic }) => topic === wanted);
    const beside = found?.topic || '';
    renderWith(this.choice, [others, beside], () => this.choiceView(others, beside));
    if (beside === this.beside) return;
    this.beside = beside;
    if (ofRobot) this.startClouds(beside, found?.type);
    else this.startRobot(beside);
  }

  /**
   * @param {server.Sensor[]} others
   * @param {string} beside
   */
  choiceView(others, beside) {
    const { ofRobot } = this;
    return pick({ class: 'beside', hidden: !others.length,
      'aria-label': ofRobot ? 'Point cloud in the view' : 'Robot in the view' },
    [['', ofRobot ? 'no point cloud' : 'no robot'], ...others.map(({ topic }) => (
      /** @type {[string, string]} */ ([topic, ofRobot ? 'with ' + topic.replace(/^\//, '')
        : 'with robot ' + topic.slice(1, -ROBOT.length - 1)])))], beside, (topic) => {
      this.wanted = topic;
      this.offer();
    });
  }

  /** @param {string} topic '' for none */
  startRobot(topic) {
    this.robot?.stop();
    this.robot = topic ? new RobotFeed(this.app, topic, this.root, { moved: () => this.changed(),
      say: (text, missing) => this.say('robot', missing ? NO_JOINTS : text) }) : null;
    this.say('robot', '');
    this.changed();
  }

  /**
   * @param {string} topic '' for none
   * @param {string} [type]
   */
  startClouds(topic, type) {
    this.clouds?.stop();
    this.cloud = null;
    setText(this.count, '');
    const which = () => numberOf(this.app, topic, type);
    this.clouds = topic ? new SensorFeed(this.app, which, this.root, {
      every: PERIOD_MS,
      beside: () => this.robot?.number,
      take: (answer, facts) => this.takeCloud(answer, facts),
      say: (text) => this.say('cloud', text),
    }) : null;
    this.say('cloud', topic ? 'Waiting for the first cloud…' : '');
    this.changed();
  }

  /**
   * @param {Response} answer
   * @param {server.CloudFacts} facts
   */
  async takeCloud(answer, facts) {
    const points = unpacked(await answer.arrayBuffer(), facts);
    this.cloud = { layer: new CloudLayer(points, facts.place), facts };
    const all = facts.count < facts.of ? ' of ' + facts.of : '';
    setText(this.count, facts.count + all + ' points');
    this.changed();
  }

  /** The robot; beside a cloud only where that has a place at it. */
  get robotLayer() {
    const layer = this.robot && this.robot.layer;
    return layer && (!this.cloud || this.cloud.facts.place) ? layer : null;
  }

  changed() {
    const [robot, cloud] = [this.robotLayer, this.cloud];
    const floor = robot && this.robot ? new GridLayer(this.robot.floor) : null;
    this.scene.show([floor, cloud && cloud.layer, robot]);
    const isPlaced = cloud && Boolean(cloud.facts.place);
    const shape = [Boolean(robot), Boolean(cloud), isPlaced].join();
    if (shape !== this.shape && (robot || cloud)) this.home();
    this.shape = shape;
    this.showLack();
  }

  /**
   * As the sensor sees it where there is no robot: optical frames look along z with y down, others
   * along x with z up.
   */
  home() {
    const [robot, cloud] = [this.robotLayer, this.cloud];
    const optical = Boolean(cloud && !cloud.facts.place && /optical|^$/.test(cloud.facts.frame));
    const boxes = [cloud && cloud.layer.bounds(), robot && robot.bounds()];
    if (!robot) this.scene.frame(boxes, { optical });
    else {
      const near = cloud ? around(...boxes) : null;
      this.scene.frame(near ? [near] : boxes,
        { optical, azimuth: -1.15, elevation: 0.35, reach: near ? 0.9 : 1.25 });
    }
  }

  /**
   * @param {'cloud' | 'robot'} which feed says it
   * @param {string} text
   */
  say(which, text) {
    this.said[which] = text;
    this.showLack();
  }

  /** In the middle of the scene as long as it is empty, below it from then on. */
  showLack() {
    const { cloud, robot } = this.said;
    const something = Boolean(this.cloud || this.robotLayer);
    this.scene.say(something ? '' : cloud || robot);
    const lacks = this.robot ? this.robot.lacks : '';
    const lost = this.cloud && this.robot && this.cloud.facts.astray;
    const text = [lost, cloud, lacks || robot].filter(Boolean).join(' ');
    setText(this.lack, something ? text : '');
  }
}

/**
 * The box of a robot, and of what a cloud has near it.
 * @param {drawing.Box | null} [cloud]
 * @param {drawing.Box | null} [robot]
 */
function around(cloud, robot) {
  if (!cloud || !robot) return cloud || robot || null;
  const [low, high] = robot;
  const near = cloud.map((corner) => vector((axis) => (
    Math.min(high[axis] + NEAR, Math.max(low[axis] - NEAR, corner[axis])))));
  return boxAround([...near, low, high]);
}
