// @ts-check
// The object that was marked, in 3D: its points and box bright, what is around it dimmed, the robot
// beside it.
import { BoxLayer } from '../drawing/box_layer.js';
import { CloudLayer, unpacked } from '../drawing/cloud_layer.js';
import { GridLayer } from '../drawing/grid_layer.js';
import { SceneView } from '../drawing/scene_view.js';
import { diagonalOf, middleOf } from '../drawing/transforms.js';
import { h } from '../page/dom.js';
import { RobotFeed, robotOf } from '../sensors/robot_feed.js';
import { SensorFeed } from '../sensors/sensor_feed.js';

const DIM = 0.62; // what is around the object
const ROBOT_DIM = 0.35;
const SPACING = 0.007; // m between its points
const NEAR = 0.05; // m: an object that has not moved further is the same
const PERIOD_MS = 300;
const NEAREST = 0.5; // m from which it is looked at

export class ObjectView {
  /**
   * @param {page.App} app
   * @param {() => server.PerceptionSensors} numbers of the interface's sensors
   */
  constructor(app, numbers) {
    this.app = app;
    this.numbers = numbers;
    /** @type {server.MarkedObject | null} */
    this.found = null;
    /** @type {drawing.Points | null} */
    this.own = null; // points of the object
    /** @type {drawing.Vector | null} */
    this.lastPosition = null;
    /** @type {CloudLayer | null} */
    this.around = null;
    /** @type {CloudLayer | null} */
    this.object = null;
    /** @type {BoxLayer | null} */
    this.box = null;
    /** @type {number[] | undefined} */
    this.place = undefined; // of the cloud at the robot
    /** @type {RobotFeed | null} */
    this.robot = null;
    this.scene = new SceneView('The marked object and what is around it', () => this.home());
    this.robotToggle = h('button', { class: 'tool', 'aria-pressed': true,
      onclick: () => this.toggleRobot() }, 'Robot');
    this.scene.buttons.append(this.robotToggle);
    this.root = h('div', { class: 'object-view', hidden: true }, this.scene.root);
    /** @type {SensorFeed<server.CloudFacts>} */
    this.feed = new SensorFeed(app, () => (this.found ? numbers().cloud : null), this.root, {
      every: PERIOD_MS,
      beside: () => (this.robot ? this.robot.number : undefined),
      take: (answer, facts) => this.takeCloud(answer, facts),
      say: () => {},
    });
  }

  stop() {
    this.feed.stop();
    this.scene.stop();
    if (this.robot) this.robot.stop();
  }

  /** @param {server.MarkedObject | null} found null where nothing is */
  show(found) {
    const far = !found || !this.lastPosition || distance(found.position, this.lastPosition) > NEAR;
    this.found = found;
    this.root.hidden = !found;
    if (!found) return;
    const bytes = Uint8Array.from(atob(found.cloud.data), (letter) => letter.charCodeAt(0));
    this.own = unpacked(bytes.buffer, found.cloud);
    if (!this.robot) this.startRobot();
    this.build(found, this.own);
    if (far) this.home(); // while it is refined it is looked at from where it was
    this.lastPosition = found.position;
  }

  startRobot() {
    const { cloud } = this.numbers();
    const sensor = this.app.store.sensors.find((each) => each.id === cloud);
    const robot = sensor ? robotOf(this.app, sensor.topic) : '';
    this.robotToggle.hidden = !robot;
    if (!robot) return;
    this.robot = new RobotFeed(this.app, robot, this.root,
      { moved: () => this.compose(), say: () => {} });
  }

  get showsRobot() { return this.robotToggle.getAttribute('aria-pressed') === 'true'; }

  toggleRobot() {
    this.robotToggle.setAttribute('aria-pressed', String(!this.showsRobot));
    this.compose();
  }

  /**
   * @param {Response} answer
   * @param {server.CloudFacts} facts
   */
  async takeCloud(answer, facts) {
    const moved = JSON.stringify(facts.place) !== JSON.stringify(this.place);
    const points = unpacked(await answer.arrayBuffer(), facts);
    this.around = new CloudLayer(points, facts.place, { dim: DIM });
    this.place = facts.place;
    if (moved && this.found && this.own) {
      this.build(this.found, this.own);
      this.home();
    } else {
      this.compose();
    }
  }

  /**
   * @param {server.MarkedObject} found
   * @param {drawing.Points} own
   */
  build(found, { points, colours }) {
    const copy = { points: points.slice(), colours };
    this.object = new CloudLayer(copy, this.place, { spacing: SPACING });
    this.box = new BoxLayer(found, this.place);
    this.compose();
  }

  compose() {
    const { robot } = this;
    const layer = robot && robot.layer;
    if (layer) layer.dim = ROBOT_DIM;
    const shown = layer && this.place && this.showsRobot ? layer : null;
    const floor = robot && shown ? new GridLayer(robot.floor) : null;
    this.scene.show([floor, this.around, shown, this.object, this.box]);
  }

  /** From the side, so that the robot does not stand in between. */
  home() {
    if (!this.box) return;
    const box = this.box.bounds();
    this.scene.orbit.look(middleOf(box), Math.max(NEAREST, 3.5 * diagonalOf(box)),
      { azimuth: -1.1, elevation: 0.55 });
  }
}

/**
 * @param {drawing.Vector} one
 * @param {drawing.Vector} other
 */
function distance(one, other) {
  return Math.hypot(one[0] - other[0], one[1] - other[1], one[2] - other[2]);
}
