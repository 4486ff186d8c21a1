// All containers of all robots: one of them drawn, live.
import { arrange, h, redraw, replace, setText } from './dom.js';
import { Graph } from './graph.js';
import { StateList } from './state_list.js';
import { remember, remembered } from './alerts.js';

export const machines = { id: 'machines', title: 'Machines', create: (app) => new Machines(app) };

// What a robot's section says, and what its open questions tell: a page that came late has not heard of the failure.
function liveOf(store, robot) {
  const live = store.get('live ' + robot);
  if (!live) return { active: {}, latest: {}, failed: {}, rates: {}, counts: {}, paths: [] };
  const failed = Object.assign({}, live.failed);
  for (const question of store.get('questions') || []) {
    if (question.robot === robot) failed[question.path] = { state: question.state };
  }
  return Object.assign({}, live, { failed });
}

// The drawing of one container, or its list.
export class MachineView {
  constructor(store, onOpen) {
    this.store = store;
    this.graph = new Graph(onOpen);
    this.list = new StateList(onOpen);
    this.prefersList = false;
    this.note = h('p', { class: 'dim note' });
    this.root = h('div', { class: 'machine-view' });
  }

  show(robot, path) {
    this.robot = robot;
    this.path = path;
    this.update();
  }

  // Whether there is a choice between a drawing and a list.
  get drawable() {
    const data = this.store.get('graph ' + this.robot + ' ' + this.path);
    return Boolean(data && data.drawn);
  }

  update() {
    const data = this.store.get('graph ' + this.robot + ' ' + this.path);
    const live = liveOf(this.store, this.robot);
    if (!data) {
      replace(this.root, h('p', { class: 'empty' }, 'Nothing is known of this machine. It is shown while its introspection is on.'));
      this.shown = '';
      return;
    }
    const drawn = data.drawn && !this.prefersList;
    const shown = drawn ? 'graph' : 'list';
    if (shown !== this.shown) replace(this.root, drawn ? this.graph.root : [this.note, this.list.root]);
    this.shown = shown;
    setText(this.note, data.drawn || this.prefersList ? '' : 'Shown as a list: there is no drawing of it, or not yet. Drawings need Graphviz on the console’s machine, and a machine that it can lay out in time.');
    if (drawn) {
      this.graph.set(this.robot, data);
      this.graph.setLive(live);
    } else {
      this.list.set(this.robot, data, live);
    }
  }
}

class Machines {
  constructor(app) {
    this.app = app;
    this.robot = '';
    this.path = '';
    this.view = new MachineView(app.store, (path) => this.open(this.robot, path));
    this.view.prefersList = remembered('machine-list', 'no') === 'yes';
    this.picker = h('div', { class: 'picker', role: 'tree', 'aria-label': 'Robots and their machines' });
    this.title = h('h2', { class: 'ellipsis' });
    this.state = h('span', { class: 'dim ellipsis' });
    this.toggle = h('button', { class: 'tool', onclick: () => this.toggleList() });
    this.body = h('section', { class: 'card machine-card' },
      h('div', { class: 'row head' }, this.title, this.state, h('span', { class: 'spacer' }), this.toggle), this.view.root, legend());
    this.root = h('div', { class: 'panel machines' }, this.picker, this.body);
    this.empty = h('p', { class: 'empty' }, 'No robots yet. Every state machine that publishes its structure, or runs under the oracle, appears here by itself.');
    this.showToggle();
  }

  toggleList() {
    this.view.prefersList = !this.view.prefersList;
    remember('machine-list', this.view.prefersList ? 'yes' : 'no');
    this.showToggle();
    this.view.update();
  }

  showToggle() { setText(this.toggle, this.view.prefersList ? 'Graph' : 'List'); }

  open(robot, path) {
    this.robot = robot;
    this.path = path;
    this.update(['robots']);
  }

  shown() { this.update(['robots']); }

  update(names) {
    if (!names.some((name) => name === 'robots' || name === 'questions' || name.startsWith('live ') || name.startsWith('graph '))) return;
    const robots = (this.app.store.get('robots') || []).filter((robot) => this.paths(robot).length);
    if (!robots.includes(this.robot)) {
      this.robot = robots.find((robot) => this.live(robot).alive) || robots[0] || '';
      this.path = '';
    }
    const paths = this.paths(this.robot);
    if (!paths.includes(this.path)) this.path = paths[0] || '';
    arrange(this.root, robots.length ? [this.picker, this.body] : this.empty);
    this.fillPicker(robots);
    setText(this.title, this.path || this.robot);
    const live = this.live(this.robot);
    setText(this.state, this.robot + (live.alive === false ? ' · gone' : ''));
    if (this.robot) this.view.show(this.robot, this.path);
    this.toggle.hidden = !this.view.drawable;
  }

  live(robot) { return liveOf(this.app.store, robot); }

  paths(robot) { return this.live(robot).paths; }

  fillPicker(robots) {
    const shown = robots.map((robot) => {
      const live = this.live(robot);
      return [robot, live.alive, this.paths(robot).map((path) => [path, Boolean(live.failed[path]),
        live.alive && (live.active[path] || []).some((label) => label && label !== 'None'), robot === this.robot && path === this.path])];
    });
    const key = JSON.stringify(shown);
    if (key === this.pickerKey) return;
    this.pickerKey = key;
    redraw(this.picker, shown.map(([robot, alive, paths]) => h('div', { key: robot, class: 'group' },
      h('div', { class: 'robot' + (alive ? '' : ' gone') }, h('span', { class: 'dot' }), robot),
      paths.map(([path, failed, active, current]) => h('button', {
        key: path, class: 'path' + (active ? ' active' : '') + (failed ? ' failed' : ''), role: 'treeitem', 'aria-selected': current,
        '--depth': path.split('/').length - 1, onclick: () => this.open(robot, path), title: path }, path.split('/').pop())))));
  }
}

function legend() {
  return h('div', { class: 'legend' },
    h('span', {}, 'failure rate ', h('span', { class: 'scale' }), ' 0 to 100%'),
    h('span', {}, h('span', { class: 'swatch active' }), 'active'), h('span', {}, h('span', { class: 'swatch failed' }), 'failed, being recovered'),
    h('span', {}, h('span', { class: 'swatch oracle' }), 'oracle: pale until used'));
}
