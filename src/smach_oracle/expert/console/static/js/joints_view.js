// Joint states: a table, and the chosen ones over the last minute.
import { arrange, h, replace, setText } from './dom.js';
import { FrameFeed, numberOf } from './frame_feed.js';

const SPAN_S = 60;
const MOST_PLOTTED = 4;
const QUANTITIES = ['position', 'velocity', 'effort'];
const HUES = [245, 20, 150, 320];

export class JointsView {
  constructor(app, topic, type) {
    this.chosen = [];
    this.rows = new Map();
    this.samples = [];
    this.quantity = 0;
    this.plot = h('canvas', { class: 'plot', role: 'img', 'aria-label': 'Chosen joints over time' });
    this.legend = h('p', { class: 'plot-legend' });
    this.note = h('p', { class: 'view-note', role: 'status' }, 'Waiting for the first joint states…');
    this.body = h('tbody', {});
    this.pick = QUANTITIES.map((name, index) => h('button', { class: 'tool', onclick: () => this.choose(index) }, name));
    this.root = h('figure', { class: 'view joints-view', 'data-topic': topic },
      h('div', { class: 'plot-frame' }, h('div', { class: 'row' }, this.legend, h('span', { class: 'spacer' }), this.pick), this.plot),
      h('div', { class: 'table-frame' }, this.note, h('table', {}, h('thead', {}, h('tr', {}, ['Joint', ...QUANTITIES].map((title) => h('th', { scope: 'col' }, title)))), this.body)),
      h('figcaption', { class: 'row' }, h('span', { class: 'ellipsis' }, topic), h('span', { class: 'spacer' }), h('span', { class: 'dim' }, 'press up to ' + MOST_PLOTTED + ' joints to plot them')));
    this.choose(0);
    this.feed = new FrameFeed(app, () => numberOf(app, topic, type), this.root, { every: 100, take: (_, facts) => this.take(facts), say: (text) => this.say(text) });
  }

  stop() { this.feed.stop(); }

  say(text) {
    setText(this.note, text);
    this.note.hidden = !text;
  }

  choose(quantity) {
    this.quantity = quantity;
    this.pick.forEach((button, index) => button.setAttribute('aria-pressed', index === quantity));
    this.draw();
  }

  take({ joints }) {
    if (joints.some(([name]) => !this.rows.has(name))) this.build(joints);
    for (const [name, ...values] of joints) values.forEach((value, index) => setText(this.rows.get(name).cells[index], value === null ? '–' : value.toFixed(3)));
    const now = performance.now() / 1000;
    const known = new Map(joints.map(([name, ...values]) => [name, values]));
    this.samples = this.samples.filter((sample) => now - sample.time < SPAN_S);
    this.samples.push({ time: now, known });
    this.draw();
  }

  // Several nodes may take turns in telling of joints of their own.
  build(joints) {
    for (const [name] of joints) {
      if (this.rows.has(name)) continue;
      const cells = QUANTITIES.map(() => h('td', { class: 'number' }));
      const button = h('button', { class: 'link', 'aria-pressed': false, onclick: () => this.toggle(name) }, name);
      this.rows.set(name, { cells, button, root: h('tr', {}, h('th', { scope: 'row' }, button), cells) });
      if (!this.chosen.length) this.toggle(name);
    }
    arrange(this.body, [...this.rows.values()].map((row) => row.root));
  }

  toggle(name) {
    this.chosen = this.chosen.includes(name) ? this.chosen.filter((each) => each !== name) : [...this.chosen, name].slice(-MOST_PLOTTED);
    for (const [each, row] of this.rows) row.button.setAttribute('aria-pressed', this.chosen.includes(each));
    replace(this.legend, this.chosen.map((each, index) => h('span', { class: 'series', '--hue': HUES[index] }, each)));
    this.draw();
  }

  draw() {
    const ratio = window.devicePixelRatio || 1;
    const [width, height] = [this.plot.clientWidth, this.plot.clientHeight];
    if (!width || !height) return;
    Object.assign(this.plot, { width: width * ratio, height: height * ratio });
    const context = this.plot.getContext('2d');
    context.scale(ratio, ratio);
    const style = getComputedStyle(this.plot);
    const now = performance.now() / 1000;
    const series = this.chosen.map((name) => this.samples.filter((sample) => sample.known.has(name)).map((sample) => [sample.time, sample.known.get(name)[this.quantity]]).filter(([, value]) => value !== null));
    const values = series.flat().map(([, value]) => value);
    const low = values.length ? Math.min(...values) : 0;
    const high = Math.max(low + 0.01, ...values);
    const [bottom, top] = [low - 0.08 * (high - low), high + 0.2 * (high - low)];
    context.font = '11px ' + style.fontFamily;
    context.fillStyle = style.color;
    context.strokeStyle = style.borderBottomColor;
    for (const level of [low, (low + high) / 2, high]) {
      const y = height * (top - level) / (top - bottom);
      context.beginPath();
      context.moveTo(0, y);
      context.lineTo(width, y);
      context.stroke();
      if (values.length) context.fillText(level.toFixed(3), 4, y - 3);
    }
    series.forEach((line, index) => {
      context.strokeStyle = 'hsl(' + HUES[index] + ' 70% 58%)';
      context.lineWidth = 1.8;
      context.beginPath();
      for (const [time, value] of line) context.lineTo(width * (1 - (now - time) / SPAN_S), height * (top - value) / (top - bottom));
      context.stroke();
    });
  }
}
