// @ts-check
// A point cloud, with the robot that it belongs to.
import { LiveScene } from './live_scene.js';
import { ROBOT, robotOf, robotsOf } from './robot_feed.js';

export class CloudView extends LiveScene {
  /**
   * @param {page.App} app
   * @param {string} topic
   * @param {string} type
   */
  constructor(app, topic, type) {
    super(app, topic, 'Robot in the view');
    this.startClouds(topic, type);
    this.begin();
  }

  /** @override */
  offer() {
    this.offerTopics(robotsOf(this.app), robotOf(this.app, this.topic), 'no robot',
      (topic) => ['with robot', topic.slice(1, -ROBOT.length - 1)].filter(Boolean).join(' '));
  }

  /**
   * @override
   * @param {string} topic
   */
  choose(topic) { this.startRobot(topic); }
}
