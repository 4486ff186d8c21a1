// The sensors: whatever cameras, point clouds, robots and joint states the console has found; up to four at a time.
import { remember, remembered } from './alerts.js';
import { CameraView } from './camera_view.js';
import { CloudView, RobotView } from './cloud_view.js';
import { arrange, h, redraw } from './dom.js';
import { breakable } from './format.js';
import { JointsView } from './joints_view.js';

export const sensors = { id: 'sensors', title: 'Sensors', create: (app) => new Sensors(app) };

const MOST_VIEWS = 4;
const TITLES = { image: 'Cameras', cloud: 'Point clouds', robot: 'Robots in 3D', joints: 'Joints' };
const VIEWS = { image: CameraView, cloud: CloudView, robot: RobotView, joints: JointsView };

class Sensors {
  constructor(app) {
    this.app = app;
    this.views = new Map();
    this.list = h('aside', { class: 'picker sensor-list', 'aria-label': 'Sensors' });
    this.stage = h('div', { class: 'sensor-stage' });
    this.root = h('div', { class: 'panel sensors' }, this.list, this.stage);
    this.wanted = remembered('sensors', '').split('\n').filter(Boolean);
    this.showList();
  }

  get known() { return (this.app.store.get('eye') || {}).sensors || []; }

  shown() { this.showList(); }

  update(names) { if (names.includes('eye')) this.showList(); }

  showList() {
    const known = this.known;
    const shape = JSON.stringify([known, this.wanted]);
    if (shape === this.shape) return;
    this.shape = shape;
    redraw(this.list, known.length ? Object.keys(TITLES).map((kind) => this.group(kind, known.filter((each) => each.kind === kind)))
      : h('p', { class: 'dim' }, 'No sensors yet.'));
    for (const sensor of known) if (this.wanted.includes(nameOf(sensor)) && !this.views.has(nameOf(sensor))) this.open(sensor);
    this.showStage();
  }

  group(kind, found) {
    return found.length > 0 && h('div', { key: kind, class: 'group' }, h('span', { class: 'robot' }, TITLES[kind]), found.map((sensor) =>
      h('button', { key: nameOf(sensor), class: 'path', title: sensor.topic + ', ' + sensor.type, 'data-topic': sensor.topic, 'aria-selected': String(this.wanted.includes(nameOf(sensor))), onclick: () => this.toggle(sensor) },
        breakable(sensor.topic.replace(/^\//, ''), '/'))));
  }

  toggle(sensor) {
    const name = nameOf(sensor);
    if (this.wanted.includes(name)) {
      this.close(name);
    } else {
      this.wanted.push(name);
      while (this.wanted.length > MOST_VIEWS) this.close(this.wanted[0]);
    }
    remember('sensors', this.wanted.join('\n'));
    this.showList();
  }

  open(sensor) {
    const view = new VIEWS[sensor.kind](this.app, sensor.topic, sensor.type);
    view.root.append(h('button', { class: 'tool view-close', 'aria-label': 'Close ' + sensor.topic, onclick: () => this.toggle(sensor) }, '×'));
    this.views.set(nameOf(sensor), view);
  }

  close(name) {
    this.wanted = this.wanted.filter((each) => each !== name);
    const view = this.views.get(name);
    if (view) view.stop();
    this.views.delete(name);
  }

  showStage() {
    const roots = [...this.views.values()].map((view) => view.root);
    arrange(this.stage, roots.length ? roots : h('div', { class: 'empty' }, h('h2', {}, this.known.length ? 'Nothing is looked at' : 'No sensors'),
      h('p', {}, this.known.length ? 'Choose up to ' + MOST_VIEWS + ' sensors. The console listens to a sensor only while somebody looks at it.'
        : 'Cameras (Image, CompressedImage), point clouds (PointCloud2, or depth with its camera_info), robots (robot_description) and joint states appear here as soon as somebody publishes them.')));
    this.stage.dataset.views = roots.length;
  }
}

function nameOf(sensor) { return sensor.type + ' ' + sensor.topic; }
