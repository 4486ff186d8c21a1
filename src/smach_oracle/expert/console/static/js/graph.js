// One container drawn from the positions that dot gave the server. ORACLE is a rail at the right side: every state's
// edge to it and back is a short line, pale until it was used.
import { h, s, whenLetGo } from './dom.js';
import { hue, percent, times } from './format.js';

const RAIL_GAP = 96;
const RAIL_WIDTH = 64;
const MARGIN = 24;
const FOOT = 52; // px below the drawing, where the buttons are
const SMALLEST_READABLE = 0.55;

function spline(points) {
  if (points.length < 8) return '';
  let path = 'M' + points[0] + ' ' + points[1];
  const curve = points.length - 2;
  for (let i = 2; i + 5 < curve; i += 6) path += 'C' + points.slice(i, i + 6).join(' ');
  return path + 'L' + points[curve] + ' ' + points[curve + 1];
}

function shorten(text, width) {
  const most = Math.max(4, Math.floor((width - 14) / 8.7));
  return text.length <= most ? text : text.slice(0, most - 1) + '…';
}

export class Graph {
  // `onOpen(path)`: a nested container was chosen.
  constructor(onOpen) {
    this.onOpen = onOpen;
    this.layer = s('g', {});
    this.svg = s('svg', { class: 'graph', role: 'img', tabindex: '0' },
      s('defs', {}, ['edge', 'used', 'hot', 'oracle', 'failing'].map((kind) => s('marker', { id: 'arrow-' + kind, class: 'arrow ' + kind,
        viewBox: '0 0 8 8', refX: 7, refY: 4, markerWidth: 9, markerHeight: 9, markerUnits: 'userSpaceOnUse', orient: 'auto-start-reverse' },
      s('path', { d: 'M0 0.500L8 4L0 7.500z' })))), this.layer);
    this.follow = true;
    this.followButton = h('button', { class: 'tool', title: 'Keep what is active in view', onclick: () => this.setFollow(!this.follow) }, 'Follow');
    this.root = h('div', { class: 'graph-frame' }, this.svg, h('div', { class: 'tools' },
      h('button', { class: 'tool', title: 'Closer', 'aria-label': 'Closer', onclick: () => this.zoom(1.3) }, '+'),
      h('button', { class: 'tool', title: 'Farther', 'aria-label': 'Farther', onclick: () => this.zoom(1 / 1.3) }, '−'),
      h('button', { class: 'tool', title: 'All of it', onclick: () => { this.setFollow(false); this.fitted = true; this.fit(); } }, 'Fit'),
      this.followButton));
    this.view = { x: 0, y: 0, scale: 1 };
    this.setFollow(true);
    this.listen();
    new ResizeObserver(() => this.place()).observe(this.root);
  }

  // `data`: the section of a graph; null empties the drawing.
  set(robot, data) {
    const key = data ? JSON.stringify([robot, data]) : '';
    if (key === this.key) return;
    this.key = key;
    this.robot = robot;
    this.data = data;
    this.layer.replaceChildren();
    this.states = new Map();
    this.edges = new Map();
    this.focusKey = '';
    this.svg.setAttribute('aria-label', data ? 'States of ' + data.path : 'No states');
    if (!data || !data.drawn) return;
    const [width, height] = data.size;
    this.rail = width + RAIL_GAP;
    this.size = { width: data.oracle ? this.rail + RAIL_WIDTH : width, height: Math.max(height, 90) };
    if (data.oracle) this.drawOracle();
    data.edges.forEach((edge) => this.drawEdge(edge));
    data.outcomes.forEach((outcome) => this.drawOutcome(outcome));
    data.states.forEach((state) => this.drawState(state));
    this.place();
  }

  id(label) { return this.robot + '/' + this.data.path + '/' + label; }

  key3(from, outcome, to) { return JSON.stringify([from, outcome, to]); }

  drawOracle() {
    const { oracle, states, outcomes } = this.data;
    const lines = [];
    states.forEach((state, index) => {
      const [x, y, width] = state.at;
      const shift = (index % 3 - 1) * 2;
      lines.push(this.oracleLine([state.label, oracle], x + width / 2, y + 7 + shift, this.rail, y + 7 + shift));
      lines.push(this.oracleLine([oracle, state.label], this.rail, y - 9 + shift, x + width / 2 + 1, y - 9 + shift));
    });
    outcomes.forEach((outcome) => {
      const [x, y, width] = outcome.at;
      lines.push(this.oracleLine([oracle, outcome.label], this.rail, y, x + width / 2 + 1, y));
    });
    this.layer.append(...lines);
    const labels = [];
    for (let y = Math.min(60, this.size.height / 2); y < this.size.height; y += 420) {
      labels.push(s('text', { x: this.rail + RAIL_WIDTH / 2, y, class: 'oracle-name' }, shorten(oracle, 80)));
    }
    this.oracleShape = s('g', { class: 'oracle', id: this.id(oracle) },
      s('rect', { x: this.rail, y: 0, width: RAIL_WIDTH, height: this.size.height, rx: 12 }), labels);
    this.layer.append(this.oracleShape);
  }

  oracleLine([from, to], x1, y1, x2, y2) {
    const line = s('path', { class: 'edge oracle-edge', d: 'M' + x1 + ' ' + y1 + 'L' + x2 + ' ' + y2 });
    const label = s('text', { class: 'edge-label oracle-label', x: this.rail - 8, y: y1 - 4, 'text-anchor': 'end' });
    const group = s('g', {}, line, label);
    this.edges.set(JSON.stringify([from, to]), { line, label, group });
    return group;
  }

  drawEdge(edge) {
    const line = s('path', { class: 'edge', d: spline(edge.points), 'marker-end': 'url(#arrow-edge)' });
    const at = edge.label || [edge.points[0] || 0, edge.points[1] || 0];
    const label = s('text', { class: 'edge-label', x: at[0], y: at[1] + 4 }, edge.outcome);
    const group = s('g', {}, line, label);
    this.edges.set(this.key3(edge.from, edge.outcome, edge.to), { line, label, group, edge });
    this.layer.append(group);
  }

  drawOutcome({ label, at: [x, y, width, height] }) {
    this.layer.append(s('g', { class: 'outcome', id: this.id(label), transform: 'translate(' + x + ' ' + y + ')' },
      s('title', {}, label), s('rect', { x: -width / 2, y: -height / 2, width, height, rx: height / 2 }),
      s('text', { y: 4 }, shorten(label, width))));
  }

  drawState({ label, nested, at: [x, y, width, height] }) {
    const rate = s('text', { y: 15, class: 'state-rate' });
    const title = s('title', {}, label);
    const open = nested ? () => this.onOpen(this.data.path + '/' + label) : null;
    const group = s('g', { class: 'state' + (nested ? ' nested' : ''), id: this.id(label), transform: 'translate(' + x + ' ' + y + ')',
      onclick: open, onkeydown: open && ((event) => { if (event.key === 'Enter') open(); }), tabindex: nested ? '0' : null, role: nested ? 'button' : null },
    title, nested && s('rect', { class: 'behind', x: -width / 2 + 4, y: -height / 2 + 5, width, height, rx: 10 }),
    s('rect', { class: 'box', x: -width / 2, y: -height / 2, width, height, rx: 10 }),
    s('text', { y: -3, class: 'state-name' }, shorten(label, width)), rate,
    s('g', { class: 'failed-mark', transform: 'translate(' + (width / 2 - 2) + ' ' + (-height / 2 + 2) + ')' },
      s('circle', { r: 9 }), s('text', { y: 4 }, '!')));
    this.states.set(label, { group, rate, title, at: [x, y] });
    this.layer.append(group);
  }

  // What is active, learned and counted: the section `live` of a robot.
  setLive(live) {
    if (!this.data || !this.data.drawn || !live) return;
    const path = this.data.path;
    const active = live.alive ? live.active[path] || [] : [];
    const failed = live.failed[path] ? live.failed[path].state : '';
    const rates = live.rates[path] || {};
    for (const [label, shown] of this.states) {
      shown.group.classList.toggle('active', active.includes(label));
      shown.group.classList.toggle('failed', label === failed);
      this.showRate(shown, label, rates[label]);
    }
    if (this.oracleShape) this.oracleShape.classList.toggle('active', active.includes(this.data.oracle));
    this.showCounts(live.counts[path] || [], live.latest[path] || [], failed);
    const focus = failed || active.find((label) => this.states.has(label)) || '';
    const key = focus + ' ' + this.follow;
    if (this.follow && key !== this.focusKey) {
      this.focusKey = key;
      whenLetGo(this.layer, () => this.place());
    }
  }

  showRate(shown, label, learned) {
    const known = learned && learned.rate !== null;
    shown.group.classList.toggle('known', Boolean(known));
    if (!known) return;
    shown.group.style.setProperty('--hue', hue(learned.rate));
    const text = percent(learned.rate) + ' fails · ' + learned.failures + '/' + (learned.failures + learned.successes);
    if (shown.rate.textContent !== text) {
      shown.rate.textContent = text;
      shown.title.textContent = label + ': ' + text;
    }
  }

  showCounts(counts, latest, failed) {
    const found = new Map();
    for (const [from, outcome, to, count, share] of counts) {
      const key = this.edges.has(this.key3(from, outcome, to)) ? this.key3(from, outcome, to) : JSON.stringify([from, to]);
      const before = found.get(key) || { count: 0, share: 0 };
      found.set(key, { count: before.count + count, share: before.share + share });
    }
    for (const [key, shown] of this.edges) {
      const taken = found.get(key);
      const [from, to] = shown.edge ? [shown.edge.from, shown.edge.to] : JSON.parse(key);
      const hot = (latest[0] === from && latest[1] === to) || (to === this.data.oracle && from === failed)
        || (latest[0] === '' && from === this.data.oracle && to === latest[1]);
      shown.group.classList.toggle('used', Boolean(taken));
      shown.group.classList.toggle('hot', hot);
      const arrow = shown.edge ? (hot ? 'hot' : taken ? 'used' : 'edge') : hot ? 'failing' : 'oracle';
      shown.line.setAttribute('marker-end', shown.edge || taken ? 'url(#arrow-' + arrow + ')' : '');
      const share = taken ? percent(taken.share) : '';
      const text = shown.edge ? shown.edge.outcome + (share ? ' ' + share : '')
        : !taken ? '' : to === this.data.oracle ? share + ' fail' : taken.count + '×';
      if (shown.label.textContent !== text) {
        shown.label.textContent = text;
        shown.group.replaceChildren(shown.line, shown.label, ...(taken ? [s('title', {}, from + ' → ' + to + ', ' + times(taken.count))] : []));
      }
    }
  }

  setFollow(on) {
    this.follow = on;
    this.followButton.setAttribute('aria-pressed', on);
    if (on) this.place();
  }

  // Show all where it stays readable, else what is active.
  place() {
    const box = this.root.getBoundingClientRect();
    if (!this.data || !this.data.drawn || !box.width) return;
    if (!this.follow) {
      if (this.fitted) this.fit();
      else this.apply();
      return;
    }
    this.fit();
    if (this.view.scale >= SMALLEST_READABLE) return;
    const focus = [...this.states.values()].find((shown) => shown.group.classList.contains('failed'))
      || [...this.states.values()].find((shown) => shown.group.classList.contains('active')) || [...this.states.values()][0];
    const scale = Math.max(SMALLEST_READABLE, Math.min(1, (box.width - 2 * MARGIN) / this.size.width));
    const at = focus ? focus.at : [0, 0];
    const wide = this.size.width * scale > box.width - 2 * MARGIN;
    this.view = { scale, x: wide ? at[0] - box.width / scale / 2 : (this.size.width - box.width / scale) / 2,
      y: Math.max(-MARGIN, Math.min(at[1] - box.height / scale / 2, this.size.height + FOOT / scale - box.height / scale)) };
    this.apply();
  }

  fit() {
    const box = this.root.getBoundingClientRect();
    if (!this.size || !box.width) return;
    const scale = Math.min(1.15, (box.width - 2 * MARGIN) / this.size.width, (box.height - MARGIN - FOOT) / this.size.height);
    this.view = { scale, x: (this.size.width - box.width / scale) / 2, y: (this.size.height - (box.height + MARGIN - FOOT) / scale) / 2 };
    this.apply();
  }

  apply() {
    const box = this.root.getBoundingClientRect();
    const { x, y, scale } = this.view;
    this.svg.setAttribute('viewBox', [x, y, box.width / scale, box.height / scale].join(' '));
  }

  zoom(factor, at) {
    const box = this.root.getBoundingClientRect();
    const [px, py] = at || [box.width / 2, box.height / 2];
    const scale = Math.min(3, Math.max(0.08, this.view.scale * factor));
    this.setFollow(false);
    this.fitted = false;
    this.view.x += px / this.view.scale - px / scale;
    this.view.y += py / this.view.scale - py / scale;
    this.view.scale = scale;
    this.apply();
  }

  listen() {
    const pointers = new Map();
    let spread = 0;
    this.svg.addEventListener('wheel', (event) => {
      event.preventDefault();
      const box = this.root.getBoundingClientRect();
      this.zoom(Math.exp(-event.deltaY / 400), [event.clientX - box.left, event.clientY - box.top]);
    }, { passive: false });
    this.svg.addEventListener('pointerdown', (event) => { pointers.set(event.pointerId, event); spread = 0; });
    window.addEventListener('pointermove', (event) => {
      const before = pointers.get(event.pointerId);
      if (!before) return;
      pointers.set(event.pointerId, event);
      if (pointers.size === 1) {
        const [dx, dy] = [event.clientX - before.clientX, event.clientY - before.clientY];
        if (this.follow && Math.abs(dx) + Math.abs(dy) < 2) return;
        this.setFollow(false);
        this.fitted = false;
        this.view.x -= dx / this.view.scale;
        this.view.y -= dy / this.view.scale;
        this.apply();
      } else if (pointers.size === 2) {
        const [a, b] = [...pointers.values()];
        const now = Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY);
        const box = this.root.getBoundingClientRect();
        if (spread) this.zoom(now / spread, [(a.clientX + b.clientX) / 2 - box.left, (a.clientY + b.clientY) / 2 - box.top]);
        spread = now;
      }
    });
    for (const name of ['pointerup', 'pointercancel']) {
      window.addEventListener(name, (event) => { pointers.delete(event.pointerId); spread = 0; });
    }
  }
}
