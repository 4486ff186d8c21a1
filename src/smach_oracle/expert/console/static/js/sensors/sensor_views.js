// @ts-check
// The views of the sensors that are looked at: each begins when its sensor is, and stops after.
import { h } from '../page/dom.js';
import { keep } from '../page/redraw.js';
import { CameraView } from './camera_view.js';
import { JointsView } from './joints_view.js';
import { LiveScene } from './live_scene.js';

const VIEWS = { image: CameraView, cloud: LiveScene, robot: LiveScene, joints: JointsView };

export class SensorViews {
  /**
   * @param {page.App} app
   * @param {(sensor: server.Sensor) => void} [close] what the button of a view does that closes it
   */
  constructor(app, close) {
    this.app = app;
    this.close = close;
    /** @type {Map<string, { root: HTMLElement, stop(): void }>} */
    this.known = new Map(); // by name
  }

  /**
   * What stands in a view of the page for those of some sensors, and of no others.
   * @param {server.Sensor[]} sensors
   */
  of(sensors) {
    const names = sensors.map(nameOf);
    for (const [name, view] of this.known) {
      if (names.includes(name)) continue;
      view.stop();
      this.known.delete(name);
    }
    return sensors.map((sensor) => {
      const view = this.known.get(nameOf(sensor)) || this.begin(sensor);
      this.known.set(nameOf(sensor), view);
      return keep(view.root);
    });
  }

  /** @param {server.Sensor} sensor */
  begin(sensor) {
    const { kind, topic, type } = sensor;
    const { close } = this;
    const view = new VIEWS[kind](this.app, topic, type);
    if (close) {
      view.root.append(h('button', { class: 'tool view-close', 'aria-label': 'Close ' + topic,
        onclick: () => close(sensor) }, '×'));
    }
    return view;
  }
}

/** @param {server.Sensor} sensor */
export function nameOf({ type, topic }) { return type + ' ' + topic; }
