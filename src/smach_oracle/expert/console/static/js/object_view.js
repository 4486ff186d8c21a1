// The object that was marked, in 3D: its points and box bright, what is around it dimmed, the robot beside it.
import { h } from './dom.js';
import { FrameFeed } from './frame_feed.js';
import { RobotFeed, robotOf } from './robot_feed.js';
import { BoxLayer, CloudLayer, GridLayer, unpacked } from './scene_layers.js';
import { SceneView } from './scene_view.js';

const DIM = 0.62; // what is around the object
const SPACING = 0.007; // m between its points
const NEAR = 0.05; // m: an object that has not moved further is the same

export class ObjectView {
  // `numbers()`: of the sensors of the frame's image and cloud
  constructor(app, numbers) {
    Object.assign(this, { app, numbers, found: null });
    this.scene = new SceneView('The marked object and what is around it', () => this.home());
    this.withRobot = h('button', { class: 'tool', 'aria-pressed': 'true', onclick: () => this.toggleRobot() }, 'Robot');
    this.scene.buttons.append(this.withRobot);
    this.root = h('div', { class: 'object-view', hidden: true }, this.scene.root);
    this.feed = new FrameFeed(app, () => (this.found ? numbers().cloud : null), this.root, { every: 300, beside: () => (this.robot ? this.robot.number : undefined),
      take: (answer, facts) => this.takeCloud(answer, facts), say: () => {} });
  }

  stop() {
    this.feed.stop();
    this.scene.stop();
    if (this.robot) this.robot.stop();
  }

  // What was made out, as the console tells it; null where nothing is.
  show(found) {
    const far = !found || !this.last || Math.hypot(...found.position.map((each, axis) => each - this.last[axis])) > NEAR;
    this.found = found;
    this.root.hidden = !found;
    if (!found) return;
    const bytes = Uint8Array.from(atob(found.cloud.data), (letter) => letter.charCodeAt(0));
    this.own = unpacked(bytes.buffer, found.cloud);
    if (!this.robot) this.startRobot();
    this.build();
    if (far) this.home(); // while it is refined it is looked at from where it was
    this.last = found.position;
  }

  startRobot() {
    const topic = this.topicOfCloud;
    const robot = topic ? robotOf(this.app, topic) : '';
    this.withRobot.hidden = !robot;
    if (robot) this.robot = new RobotFeed(this.app, robot, this.root, { moved: () => this.compose(), say: () => {} });
  }

  get topicOfCloud() {
    const sensor = ((this.app.store.get('eye') || {}).sensors || []).find((each) => each.id === this.numbers().cloud);
    return sensor && sensor.topic;
  }

  get showsRobot() { return this.withRobot.getAttribute('aria-pressed') === 'true'; }

  toggleRobot() {
    this.withRobot.setAttribute('aria-pressed', String(!this.showsRobot));
    this.compose();
  }

  async takeCloud(answer, facts) {
    const moved = JSON.stringify(facts.place) !== JSON.stringify(this.place);
    this.around = new CloudLayer(unpacked(await answer.arrayBuffer(), facts), facts.place, { dim: DIM });
    this.place = facts.place;
    if (moved && this.found) {
      this.build();
      this.home();
    } else {
      this.compose();
    }
  }

  build() {
    const points = { points: this.own.points.slice(), colours: this.own.colours };
    this.object = new CloudLayer(points, this.place, { spacing: SPACING });
    this.box = new BoxLayer(this.found, this.place);
    this.compose();
  }

  compose() {
    const robot = this.robot && this.robot.layer;
    if (robot) robot.dim = 0.35;
    const shown = robot && this.place && this.showsRobot;
    this.scene.show([shown && new GridLayer(this.robot.floor), this.around, shown && robot, this.object, this.box]);
  }

  // From the side, so that the robot does not stand in between.
  home() {
    const [low, high] = this.box.bounds();
    const size = Math.hypot(...high.map((each, axis) => each - low[axis]));
    this.scene.orbit.look(low.map((each, axis) => (each + high[axis]) / 2), Math.max(0.5, 3.5 * size), { azimuth: -1.1, elevation: 0.55 });
  }
}
