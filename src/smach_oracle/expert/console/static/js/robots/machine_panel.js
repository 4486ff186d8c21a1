// @ts-check
// All containers of all robots: one of them is shown, live.
import { h } from '../page/dom.js';
import { aged } from '../page/liveness.js';
import { keep, redrawWith, render } from '../page/redraw.js';
import { takeArrowKeys } from '../page/tree_keys.js';
import { DownList } from './down_list.js';
import { MachineHand } from './machine_hand.js';
import { MachineView, machinesNow } from './machine_view.js';

/** @typedef {ReturnType<MachinePanel['pickerGroup']>} PickerGroup */

/** @type {page.Panel} */
export const machines = { id: 'machines', title: 'Machines',
  create: (app) => new MachinePanel(app) };

const NO_ROBOTS = 'No robots yet. Every state machine that publishes its structure, or runs under '
  + 'the oracle, appears here by itself.';

class MachinePanel {
  /** @param {page.App} app */
  constructor(app) {
    this.app = app;
    this.robot = '';
    this.path = '';
    this.picked = false; // by a person, or an address
    this.wanted = ''; // what an address names, until it is known
    this.source = machinesNow(app.store);
    this.view = new MachineView(this.source, () => this, (path) => this.open(this.robot, path));
    this.hand = new MachineHand(app, () => this);
    this.picker = h('div', { class: 'picker', role: 'tree',
      'aria-label': 'Robots and their machines' });
    takeArrowKeys(this.picker);
    this.down = new DownList(app);
    this.root = h('div', {});
  }

  /**
   * @param {string} robot
   * @param {string} path
   */
  open(robot, path) {
    this.robot = robot;
    this.path = path;
    this.picked = true;
    this.wanted = '';
    this.draw();
    this.app.went();
  }

  get place() { return this.picked ? this.robot + ' ' + this.path : ''; }

  /** @param {string} place a robot and the path of a container, '' for any */
  goTo(place) {
    this.wanted = place;
    if (!place && this.picked) {
      this.picked = false;
      this.robot = '';
      this.path = '';
    }
    this.draw();
  }

  get sections() { return /^(?:robots|questions|down|live .*|graph .*)$/; }

  draw() {
    const robots = (this.app.store.get('robots') || []).filter((robot) => this.paths(robot).length);
    this.settle(robots);
    this.down.draw();
    const groups = robots.map((robot) => this.pickerGroup(robot));
    redrawWith(this.picker, groups, () => groups.map((group) => this.pickerView(group)));
    this.view.draw();
    this.hand.draw();
    render(this.root, h('div', { class: 'panel machines' },
      robots.length ? [keep(this.picker), this.machineCard()]
        : h('p', { class: 'empty' }, NO_ROBOTS), keep(this.down.root)));
  }

  machineCard() {
    const { robot, path } = this;
    const { alive, unwell } = this.source.state(robot);
    const { liveness } = this.app;
    const gone = alive === false;
    const age = gone ? null : liveness.robot(robot);
    return h('section', { class: 'card machine-card'
      + (gone || liveness.isSilent(robot) ? ' silent' : '') },
    h('div', { class: 'row head' }, h('h2', { class: 'ellipsis' }, path || robot),
      h('span', { class: 'dim ellipsis' }, robot + (gone ? ' · gone' : '')
        + (age === null ? '' : ' · heard ' + aged(age) + ' ago')
        + (unwell ? ' · waits until it is well: ' + unwell : ''))),
    keep(this.hand.root), keep(this.view.root), legend());
  }

  /**
   * Keep to the container that is shown; where it is gone, turn to another one.
   * @param {string[]} robots
   */
  settle(robots) {
    const found = robots.find((robot) => this.wanted.startsWith(robot + ' ')
      && this.paths(robot).includes(this.wanted.slice(robot.length + 1)));
    if (found) {
      this.robot = found;
      this.path = this.wanted.slice(found.length + 1);
      this.picked = true;
      this.wanted = '';
    }
    if (!robots.includes(this.robot)) {
      this.picked = false;
      const living = robots.find((robot) => this.source.state(robot).alive);
      this.robot = living || robots[0] || '';
      this.path = '';
    }
    const paths = this.paths(this.robot);
    if (!paths.includes(this.path)) this.path = paths[0] || '';
  }

  /** @param {string} robot */
  paths(robot) { return this.source.state(robot).paths; }

  /** @param {PickerGroup} group */
  pickerView({ robot, alive, rows }) {
    return h('div', { key: robot, class: 'group', role: 'group', 'aria-label': robot },
      h('div', { class: 'robot' + (alive ? '' : ' gone') }, h('span', { class: 'dot' }), robot),
      rows.map((row) => this.pickerButton(robot, row)));
  }

  /** @param {string} robot */
  pickerGroup(robot) {
    const { alive: known, active, failed, paths } = this.source.state(robot);
    const alive = known && !this.app.liveness.isSilent(robot);
    const rows = paths.map((path) => ({
      path,
      failed: Boolean(failed[path]),
      active: Boolean(alive) && (active[path] || []).some((label) => label && label !== 'None'),
      current: robot === this.robot && path === this.path,
    }));
    return { robot, alive, rows };
  }

  /**
   * @param {string} robot
   * @param {PickerGroup['rows'][0]} row
   */
  pickerButton(robot, { path, failed, active, current }) {
    const names = path.split('/');
    return h('button', { key: path,
      class: 'path' + (active ? ' active' : '') + (failed ? ' failed' : ''), role: 'treeitem',
      'aria-selected': current, 'aria-level': names.length, tabindex: current ? 0 : -1,
      '--depth': names.length - 1,
      onclick: () => this.open(robot, path), title: path }, names[names.length - 1]);
  }
}

function legend() {
  return h('div', { class: 'legend' },
    h('span', {}, 'failure rate ', h('span', { class: 'scale' }), ' 0 to 100%'),
    h('span', {}, h('span', { class: 'swatch active' }), 'active'),
    h('span', {}, h('span', { class: 'swatch failed' }), 'failed, being recovered'),
    h('span', {}, h('span', { class: 'swatch oracle' }), 'oracle: pale until used'));
}
