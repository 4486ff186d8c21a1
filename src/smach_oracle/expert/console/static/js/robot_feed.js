// A robot, live: what it looks like, fetched once, and where its links are, again and again.
import { FrameFeed, numberOf } from './frame_feed.js';
import { RobotLayer } from './scene_layers.js';

export const ROBOT = 'robot_description';

// The robots that are known, and of these the one that a topic belongs to: it has its namespace.
export function robotsOf(app) {
  return ((app.store.get('eye') || {}).sensors || []).filter((each) => each.kind === 'robot').map((each) => each.topic);
}

export function robotOf(app, topic) {
  const found = robotsOf(app).filter((robot) => topic.startsWith(robot.slice(0, -ROBOT.length)));
  return found.sort((one, other) => other.length - one.length)[0] || '';
}

export class RobotFeed {
  // `topic`: the parameter with its description; `root`: an element on the page; `moved()`: there is something new
  constructor(app, topic, root, { moved, say }) {
    Object.assign(this, { app, topic, moved, say, layer: null, floor: 0, facts: {} });
    this.feed = new FrameFeed(app, () => this.number, root, { every: 120, take: (answer, facts) => this.take(answer, facts), say });
  }

  get number() { return numberOf(this.app, this.topic, ROBOT); }

  stop() { this.feed.stop(); }

  // What is missing of it, in words.
  get lacks() {
    const { lost = 0, missing = [], parts = [], name = '' } = this.layer ? this.layer.model : {};
    return [this.layer && !parts.length && 'Nothing of ' + (name || 'the robot') + ' can be drawn.',
      lost > 0 && lost + (lost === 1 ? ' mesh' : ' meshes') + ' could not be read: ' + missing[0] + (lost > 1 ? ', …' : ''),
      this.layer && this.facts.joints === 0 && 'No joint states yet: every joint is drawn at zero.'].filter(Boolean).join(' ');
  }

  async take(answer, facts) {
    const poses = new Float32Array(await answer.arrayBuffer());
    if (!this.layer || this.layer.model.version !== facts.model) {
      const model = await this.fetchModel();
      if (model.version !== facts.model || poses.length !== 12 * model.links.length) return; // it has changed meanwhile
      this.layer = new RobotLayer(model, poses);
      const box = this.layer.bounds();
      this.floor = box ? Math.min(0, box[0][2]) : 0; // of one whose root is not at its feet
    }
    this.layer.poses = poses;
    this.facts = facts;
    this.moved();
  }

  async fetchModel() {
    const answer = await this.app.link.fetch('model/' + this.number);
    if (!answer.ok) throw new Error(answer.status);
    return modelOf(await answer.arrayBuffer());
  }
}

// A robot as the console sends it.
function modelOf(data) {
  const length = new DataView(data).getUint32(0, true);
  const model = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
  let at = 4 + length;
  model.geometries = model.geometries.map((told) => {
    const raw = new Uint16Array(data, at, 3 * told.corners);
    const triangles = new Uint16Array(data, at + raw.byteLength, 3 * told.triangles);
    at += raw.byteLength + triangles.byteLength;
    const corners = new Float32Array(raw.length);
    for (let i = 0; i < raw.length; i += 1) corners[i] = told.offset[i % 3] + told.scale[i % 3] * raw[i] / 65535;
    return { corners, triangles, box: [told.offset, told.offset.map((low, axis) => low + told.scale[axis])] };
  });
  return model;
}
