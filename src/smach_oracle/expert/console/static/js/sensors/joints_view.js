// @ts-check
// Joint states: a table, and the chosen ones over the last minute.
import { h, setText } from '../page/dom.js';
import { redraw, render } from '../page/redraw.js';
import { JointPlot, SPAN_S, legendOf } from './joint_plot.js';
import { SensorFeed, numberOf } from './sensor_feed.js';

/** @typedef {import('./joint_plot.js').Sample} Sample */

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
    /** @type {Map<string, (number | null)[]>} */
    this.latest = new Map(); // by joint; several nodes may take turns in publishing their own
    /** @type {{ time: number, joints: Map<string, server.JointRow> }[]} */
    this.samples = [];
    this.quantity = 0;
    this.plot = new JointPlot();
    this.head = h('div', {});
    this.note = h('p', { class: 'view-note', role: 'status' },
      'Waiting for the first joint states…');
    this.body = h('tbody', {});
    this.root = this.build(topic);
    this.draw();
    /** @type {SensorFeed<server.JointFacts>} */
    this.feed = new SensorFeed(app, () => numberOf(app, topic, type), this.root,
      { every: PERIOD_MS, take: (_, facts) => this.take(facts),
        say: (text) => setText(this.note, text) });
  }

  /** @param {string} topic */
  build(topic) {
    const titles = ['Joint', ...QUANTITIES].map((title) => h('th', { scope: 'col' }, title));
    return h('figure', { class: 'view joints-view', 'data-topic': topic },
      h('div', { class: 'plot-frame' }, this.head, this.plot.canvas),
      h('div', { class: 'table-frame' }, this.note,
        h('table', {}, h('thead', {}, h('tr', {}, titles)), this.body)),
      h('figcaption', { class: 'row' }, h('span', { class: 'ellipsis' }, topic),
        h('span', { class: 'spacer' }),
        h('span', { class: 'dim' }, 'press up to ' + MOST_PLOTTED + ' joints to plot them')));
  }

  stop() { this.feed.stop(); }

  /** @param {server.JointFacts} facts */
  take({ joints }) {
    for (const [name, ...values] of joints) this.latest.set(name, values);
    if (!this.chosen.length && joints.length) this.chosen = [joints[0][0]];
    const time = performance.now() / 1000;
    this.samples = this.samples.filter((sample) => time - sample.time < SPAN_S);
    this.samples.push({ time, joints: new Map(joints.map((joint) => [joint[0], joint])) });
    this.draw();
  }

  /** @param {string} name */
  toggle(name) {
    if (this.chosen.includes(name)) this.chosen = this.chosen.filter((each) => each !== name);
    else this.chosen = [...this.chosen, name].slice(-MOST_PLOTTED);
    this.draw();
  }

  draw() {
    render(this.head, h('div', { class: 'row' }, legendOf(this.chosen),
      h('span', { class: 'spacer' }), QUANTITIES.map((name, index) => h('button', { class: 'tool',
        'aria-pressed': index === this.quantity, onclick: () => {
          this.quantity = index;
          this.draw();
        } }, name))));
    redraw(this.body, [...this.latest].map(([name, values]) => h('tr', { key: name },
      h('th', { scope: 'row' }, h('button', { class: 'link', onclick: () => this.toggle(name),
        'aria-pressed': this.chosen.includes(name) }, name)),
      values.map((value) => (
        h('td', { class: 'number' }, value === null ? '–' : value.toFixed(3)))))));
    const curves = this.chosen.map((name) => this.samples.flatMap(({ time, joints }) => {
      const value = joints.get(name)?.[/** @type {1 | 2 | 3} */ (this.quantity + 1)];
      /** @type {Sample[]} */
      const found = value === null || value === undefined ? [] : [[time, value]];
      return found;
    }));
    this.plot.draw(curves, performance.now() / 1000);
  }
}
