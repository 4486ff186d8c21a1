// @ts-check
// Joint states: a table, and the chosen ones over the last minute.
import { h, replace, say, setText } from '../page/dom.js';
import { arrange } from '../page/redraw.js';
import { HUES, JointPlot, SPAN_S } from './joint_plot.js';
import { SensorFeed, numberOf } from './sensor_feed.js';

/** @typedef {import('./joint_plot.js').Sample} Sample */
/** @typedef {{ cells: HTMLElement[], button: HTMLElement, root: HTMLElement }} Row */

const PERIOD_MS = 100;
const MOST_PLOTTED = 4;
const QUANTITIES = ['position', 'velocity', 'effort'];

export class JointsView {
  /**
   * @param {page.App} app
   * @param {string} topic
   * @param {string} type
   */
  constructor(app, topic, type) {
    /** @type {string[]} */
    this.chosen = [];
    /** @type {Map<string, Row>} */
    this.rows = new Map();
    /** @type {{ time: number, joints: Map<string, server.JointRow> }[]} */
    this.samples = [];
    this.quantity = 0;
    this.plot = new JointPlot();
    this.legend = h('p', { class: 'plot-legend' });
    this.note = h('p', { class: 'view-note', role: 'status' },
      'Waiting for the first joint states…');
    this.body = h('tbody', {});
    this.buttons = QUANTITIES.map((name, index) => (
      h('button', { class: 'tool', onclick: () => this.choose(index) }, name)));
    this.root = this.build(topic);
    this.choose(0);
    /** @type {SensorFeed<server.JointFacts>} */
    this.feed = new SensorFeed(app, () => numberOf(app, topic, type), this.root,
      { every: PERIOD_MS, take: (_, facts) => this.take(facts),
        say: (text) => say(this.note, text) });
  }

  /** @param {string} topic */
  build(topic) {
    const titles = ['Joint', ...QUANTITIES].map((title) => h('th', { scope: 'col' }, title));
    return h('figure', { class: 'view joints-view', 'data-topic': topic },
      h('div', { class: 'plot-frame' },
        h('div', { class: 'row' }, this.legend, h('span', { class: 'spacer' }), this.buttons),
        this.plot.canvas),
      h('div', { class: 'table-frame' }, this.note,
        h('table', {}, h('thead', {}, h('tr', {}, titles)), this.body)),
      h('figcaption', { class: 'row' }, h('span', { class: 'ellipsis' }, topic),
        h('span', { class: 'spacer' }),
        h('span', { class: 'dim' }, 'press up to ' + MOST_PLOTTED + ' joints to plot them')));
  }

  stop() { this.feed.stop(); }

  /** @param {number} quantity */
  choose(quantity) {
    this.quantity = quantity;
    this.buttons.forEach((button, index) => {
      button.setAttribute('aria-pressed', String(index === quantity));
    });
    this.draw();
  }

  /** @param {server.JointFacts} facts */
  take({ joints }) {
    if (joints.some(([name]) => !this.rows.has(name))) this.addRows(joints);
    for (const [name, ...values] of joints) {
      const row = this.rows.get(name);
      values.forEach((value, index) => {
        if (row) setText(row.cells[index], value === null ? '–' : value.toFixed(3));
      });
    }
    const time = performance.now() / 1000;
    this.samples = this.samples.filter((sample) => time - sample.time < SPAN_S);
    this.samples.push({ time, joints: new Map(joints.map((joint) => [joint[0], joint])) });
    this.draw();
  }

  /**
   * Several nodes may take turns in publishing joints of their own.
   * @param {server.JointRow[]} joints
   */
  addRows(joints) {
    for (const [name] of joints) {
      if (this.rows.has(name)) continue;
      const cells = QUANTITIES.map(() => h('td', { class: 'number' }));
      const button = h('button', { class: 'link', 'aria-pressed': false,
        onclick: () => this.toggle(name) }, name);
      const root = h('tr', {}, h('th', { scope: 'row' }, button), cells);
      this.rows.set(name, { cells, button, root });
      if (!this.chosen.length) this.toggle(name);
    }
    arrange(this.body, [...this.rows.values()].map((row) => row.root));
  }

  /** @param {string} name */
  toggle(name) {
    if (this.chosen.includes(name)) this.chosen = this.chosen.filter((each) => each !== name);
    else this.chosen = [...this.chosen, name].slice(-MOST_PLOTTED);
    for (const [each, row] of this.rows) {
      row.button.setAttribute('aria-pressed', String(this.chosen.includes(each)));
    }
    replace(this.legend, this.chosen.map((each, index) => (
      h('span', { class: 'series', '--hue': HUES[index] }, each))));
    this.draw();
  }

  draw() {
    const curves = this.chosen.map((name) => this.samples.flatMap(({ time, joints }) => {
      const value = joints.get(name)?.[/** @type {1 | 2 | 3} */ (this.quantity + 1)];
      /** @type {Sample[]} */
      const found = value === null || value === undefined ? [] : [[time, value]];
      return found;
    }));
    this.plot.draw(curves, performance.now() / 1000);
  }
}
