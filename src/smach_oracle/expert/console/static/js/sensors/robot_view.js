// @ts-check
// A robot, with a point cloud that a person has chosen.
import { setText } from '../page/dom.js';
import { LiveScene } from './live_scene.js';

export class RobotView extends LiveScene {
  /**
   * @param {page.App} app
   * @param {string} topic
   */
  constructor(app, topic) {
    super(app, topic, 'Point cloud in the view');
    this.startRobot(topic);
    this.begin();
  }

  get knownClouds() { return this.app.store.sensors.filter((each) => each.kind === 'cloud'); }

  /** @override */
  offer() {
    const topics = this.knownClouds.map((each) => each.topic);
    this.offerTopics(topics, this.choice.value, 'no point cloud',
      (topic) => 'with ' + topic.replace(/^\//, ''));
  }

  /**
   * @override
   * @param {string} topic
   */
  choose(topic) {
    this.startClouds(topic, this.knownClouds.find((each) => each.topic === topic)?.type);
    if (!topic) setText(this.count, '');
  }
}
