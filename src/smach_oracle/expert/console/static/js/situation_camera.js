// The robot's camera beside a question: live, closed until somebody opens it.
import { CameraView } from './camera_view.js';
import { h, replace } from './dom.js';

// Colour first, raw or compressed alike; depth and everything else after it.
const RANK = [/\/(rgb|color|colour)\//, /image_(raw|rect|color)/, /./];

// The cameras of a robot: those of its namespace, or all that there are.
export function camerasOf(app, robot) {
  const space = robot.slice(0, robot.lastIndexOf('/') + 1);
  const sensors = ((app.store.get('eye') || {}).sensors || []).filter((each) => each.kind === 'image' && !/depth|disparity/.test(each.topic));
  const own = sensors.filter((each) => each.topic.startsWith(space));
  const rank = (each) => RANK.findIndex((pattern) => pattern.test(each.topic));
  return (own.length ? own : sensors).sort((one, other) => rank(one) - rank(other) || one.topic.localeCompare(other.topic));
}

export class SituationCamera {
  constructor(app, question) {
    this.app = app;
    this.question = question;
    this.choice = h('select', { 'aria-label': 'Camera', onchange: () => this.look() });
    this.frame = h('div', {});
    this.root = h('details', { class: 'card situation-camera', ontoggle: () => this.look() }, h('summary', {}, h('h3', {}, 'Camera, live')), this.choice, this.frame);
    this.update();
  }

  update() {
    const cameras = camerasOf(this.app, this.question.robot);
    this.root.hidden = !cameras.length;
    const shape = JSON.stringify(cameras.map((each) => each.topic));
    if (shape === this.shape) return;
    this.shape = shape;
    const before = this.choice.value;
    replace(this.choice, cameras.map((each) => h('option', { value: each.topic, selected: each.topic === before }, each.topic)));
    this.choice.hidden = cameras.length < 2;
    this.look();
  }

  look() {
    const topic = this.root.open ? this.choice.value : '';
    if (topic === this.topic) return;
    this.topic = topic;
    this.stop();
    this.view = topic ? new CameraView(this.app, topic) : null;
    replace(this.frame, this.view && this.view.root);
  }

  stop() { if (this.view) this.view.stop(); }
}
