// @ts-check
// A robot, live: what it looks like, fetched once, and where its links are, again and again.
import { RobotLayer } from '../drawing/robot_layer.js';
import { vector } from '../drawing/transforms.js';
import { counted } from '../page/format.js';
import { SensorFeed, numberOf } from './sensor_feed.js';

/** @typedef {import('./sensor_feed.js').Missing} Missing */

export const ROBOT = 'robot_description';
const PERIOD_MS = 120;

/**
 * The robot that a topic belongs to: it has its namespace. '' where there is none.
 * @param {page.App} app
 * @param {string} topic
 */
export function robotOf({ store }, topic) {
  const found = store.sensors.filter((each) => (
    each.kind === 'robot' && topic.startsWith(each.topic.slice(0, -ROBOT.length))));
  return found.sort((one, other) => other.topic.length - one.topic.length)[0]?.topic || '';
}

export class RobotFeed {
  /**
   * @param {page.App} app
   * @param {string} topic the parameter with its description
   * @param {Element} root nothing is asked for while it is not on the page
   * @param {{ moved: () => void, say: (text: string, missing: Missing) => void }} use moved: there
   *   is something new
   */
  constructor(app, topic, root, { moved, say }) {
    this.app = app;
    this.topic = topic;
    this.moved = moved;
    /** @type {RobotLayer | null} */
    this.layer = null;
    this.floor = 0; // m
    this.joints = NaN; // that are known
    /** @type {SensorFeed<server.RobotFacts>} */
    this.feed = new SensorFeed(app, () => this.number, root,
      { every: PERIOD_MS, take: (answer, facts) => this.take(answer, facts), say });
  }

  get number() { return numberOf(this.app, this.topic, ROBOT); }

  stop() { this.feed.stop(); }

  /** What is missing of it, in words. */
  get lacks() {
    if (!this.layer) return '';
    const { lost, missing, parts, name } = this.layer.model;
    const meshes = counted(lost, 'mesh', 'meshes') + ' could not be read: ' + missing[0]
      + (lost > 1 ? ', …' : '');
    return [!parts.length && 'Nothing of ' + (name || 'the robot') + ' can be drawn.',
      lost > 0 && meshes,
      this.joints === 0 && 'No joint states yet: every joint is drawn at zero.',
    ].filter(Boolean).join(' ');
  }

  /**
   * @param {Response} answer
   * @param {server.RobotFacts} facts
   */
  async take(answer, facts) {
    const poses = new Float32Array(await answer.arrayBuffer());
    if (!this.layer || this.layer.model.version !== facts.model) {
      const model = await this.fetchModel();
      const changed = model.version !== facts.model || poses.length !== 12 * model.links.length;
      if (changed) return; // meanwhile
      this.layer = new RobotLayer(model, poses);
      const box = this.layer.bounds();
      this.floor = box ? Math.min(0, box[0][2]) : 0; // of one whose root is not at its feet
    }
    this.layer.poses = poses;
    this.joints = facts.joints;
    this.moved();
  }

  async fetchModel() {
    const answer = await this.app.connection.fetch('model/' + this.number);
    if (!answer.ok) throw new Error(String(answer.status));
    return modelOf(await answer.arrayBuffer());
  }
}

/**
 * A robot as the server sends it.
 * @param {ArrayBuffer} data
 * @returns {drawing.RobotModel}
 */
function modelOf(data) {
  const length = new DataView(data).getUint32(0, true);
  /** @type {server.ModelHeader} */
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
  let at = 4 + length;
  const geometries = header.geometries.map((geometry) => {
    const raw = new Uint16Array(data, at, 3 * geometry.corners);
    const triangles = new Uint16Array(data, at + raw.byteLength, 3 * geometry.triangles);
    at += raw.byteLength + triangles.byteLength;
    return geometryOf(raw, triangles, geometry.offset, geometry.scale);
  });
  return { ...header, geometries };
}

/**
 * @param {Uint16Array} raw
 * @param {Uint16Array} triangles
 * @param {drawing.Vector} offset
 * @param {drawing.Vector} scale
 * @returns {drawing.Geometry}
 */
function geometryOf(raw, triangles, offset, scale) {
  const corners = new Float32Array(raw.length);
  for (let i = 0; i < raw.length; i += 1) {
    corners[i] = offset[i % 3] + scale[i % 3] * raw[i] / 65535;
  }
  return { corners, triangles, box: [offset, vector((axis) => offset[axis] + scale[axis])] };
}
