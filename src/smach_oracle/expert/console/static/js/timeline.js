// A trial on a time axis: a lane for each state, one for the oracle, one for the expert.
import { h, redraw, s } from './dom.js';
import { duration } from './format.js';

const LANE = 26;
const NAME = 168;
const TOP = 6;
const AXIS = 24;
const MARKS = { failure: 'bad', decision: 'oracle', jump: 'oracle', supersede: 'expert', give_up: 'bad', warning: 'warn',
  query_opened: 'expert', query_claimed: 'expert', query_answered: 'expert', query_expired: 'bad', interface_start: 'expert', interface_end: 'expert',
  precondition_start: 'oracle', precondition_end: 'oracle', preempt: 'warn' };

export class Timeline {
  // `onPick(seq)`: an event was chosen; `onSeek(t)`: a time; `onKey(event)`: a key while the cursor has the focus
  constructor({ onPick, onSeek, onKey }) {
    Object.assign(this, { onPick, onSeek });
    this.cursor = h('div', { class: 'cursor-line' });
    this.lanes = h('div', {});
    this.canvas = h('div', { class: 'timeline-canvas' }, this.lanes, this.cursor);
    this.handle = h('div', { class: 'cursor-handle' });
    this.axis = h('div', { class: 'axis' });
    this.slider = h('div', { class: 'cursor-rail', role: 'slider', tabindex: '0', 'aria-label': 'Time in the trial', 'aria-valuemin': 0, onkeydown: onKey }, this.axis, this.handle);
    this.root = h('div', { class: 'timeline' }, this.slider, this.canvas);
    for (const element of [this.slider, this.canvas]) this.listen(element);
    new ResizeObserver(() => this.draw()).observe(this.root);
  }

  // Press and drag, by mouse, pen or finger; up and down still scrolls the page.
  listen(element) {
    let dragged = -1;
    const seek = (event) => {
      if (!this.scale) return;
      const { left, right, begin, whole } = this.scale;
      const box = this.root.getBoundingClientRect();
      const share = (event.clientX - box.left - left) / (right - left);
      this.onSeek(begin + whole * Math.min(1, Math.max(0, share)));
    };
    element.addEventListener('pointerdown', (event) => {
      if (event.button || event.target.classList.contains('mark') || event.clientX - this.root.getBoundingClientRect().left < (this.scale || { left: 0 }).left - 12) return;
      dragged = event.pointerId;
      element.setPointerCapture(dragged);
      this.slider.focus({ preventScroll: true });
      event.preventDefault();
      seek(event);
    });
    element.addEventListener('pointermove', (event) => { if (event.pointerId === dragged) seek(event); });
    for (const name of ['pointerup', 'pointercancel']) element.addEventListener(name, () => { dragged = -1; });
  }

  // The cursor to a time; `words`: what is there.
  place(t, words) {
    this.t = t;
    this.wordsThere = words;
    if (!this.scale) return;
    const { left, right, begin, whole } = this.scale;
    const share = Math.min(1, Math.max(0, (t - begin) / whole));
    const at = left + (right - left) * share;
    this.handle.style.setProperty('--at', at + 'px');
    this.cursor.style.setProperty('--at', at + 'px');
    this.slider.setAttribute('aria-valuemax', whole.toFixed(2));
    this.slider.setAttribute('aria-valuenow', (whole * share).toFixed(2));
    this.slider.setAttribute('aria-valuetext', words);
  }

  set(events, end) {
    this.events = events;
    this.end = end;
    this.draw();
  }

  pick(seq) {
    this.picked = seq;
    for (const mark of this.root.querySelectorAll('[data-seq]')) mark.classList.toggle('picked', Number(mark.dataset.seq) === seq);
    const event = (this.events || []).find((each) => each.seq === seq);
    const lane = event && this.shownLanes ? this.shownLanes.indexOf(laneOf(event)) : -1;
    if (lane < 0) return;
    const top = TOP + lane * LANE;
    const { scrollTop, clientHeight } = this.canvas;
    if (top < scrollTop || top + LANE > scrollTop + clientHeight) this.canvas.scrollTop = top - clientHeight / 2;
  }

  draw() {
    const width = this.canvas.clientWidth;
    if (!this.events || !this.events.length || width < 50) {
      redraw(this.lanes, h('p', { class: 'empty' }, 'No events.'));
      this.scale = null;
      this.slider.hidden = this.cursor.hidden = true;
      return;
    }
    const { lanes, bars } = spans(this.events, this.end);
    const name = Math.min(NAME, width * 0.3);
    const begin = this.events[0].t;
    const whole = Math.max(this.end - begin, 0.001);
    this.scale = { left: name, right: width - 14, begin, whole };
    this.slider.hidden = this.cursor.hidden = false;
    const x = (t) => name + (width - name - 14) * Math.min(1, Math.max(0, (t - begin) / whole));
    const height = TOP + lanes.length * LANE + 6;
    const y = (lane) => TOP + lanes.indexOf(lane) * LANE;
    this.shownLanes = lanes;
    this.cursor.style.setProperty('--height', height + 'px');
    const marks = ticks(whole, Math.max(2, (width - name) / 62));
    redraw(this.axis, s('svg', { width, height: AXIS, viewBox: '0 0 ' + width + ' ' + AXIS, 'aria-hidden': true },
      marks.map((tick) => s('text', { class: 'tick-text', x: Math.min(x(begin + tick), width - 26), y: 16 }, tick < 10 ? Math.round(tick * 100) / 100 + ' s' : duration(tick)))));
    redraw(this.lanes, s('svg', { width, height, viewBox: '0 0 ' + width + ' ' + height, role: 'img', 'aria-label': 'Events of the trial over time' },
      marks.map((tick) => s('line', { class: 'tick', x1: x(begin + tick), x2: x(begin + tick), y1: 0, y2: height })),
      lanes.map((lane) => s('text', { class: 'lane', x: 0, y: y(lane) + 16 }, short(lane, name), s('title', {}, lane))),
      bars.map((bar) => s('rect', { class: 'bar ' + bar.kind, x: x(bar.from), y: y(bar.lane) + 4, rx: 3, height: LANE - 8,
        width: Math.max(2, x(bar.to) - x(bar.from)) }, s('title', {}, bar.words))),
      this.events.filter((event) => MARKS[event.kind]).map((event) => s('circle', {
        key: event.seq, class: 'mark ' + MARKS[event.kind] + (event.seq === this.picked ? ' picked' : ''), cx: x(event.t), cy: y(laneOf(event)) + LANE / 2, r: 4.5,
        'data-seq': event.seq, onclick: () => this.onPick(event.seq) }, s('title', {}, event.words)))));
    if (this.t !== undefined) this.place(this.t, this.wordsThere);
  }
}

function short(lane, width) {
  const most = Math.floor((width - 8) / 7.7);
  const label = lane.split('/').pop();
  return label.length > most ? label.slice(0, most - 1) + '…' : label;
}

function laneOf(event) {
  if (event.kind.startsWith('query') || event.kind.startsWith('interface') || event.kind === 'supersede') return 'expert';
  if (MARKS[event.kind] === 'oracle' || event.kind === 'give_up') return 'oracle';
  return event.state ? event.path + '/' + event.state : 'oracle';
}

// Lanes in the order of their first event, expert and oracle at the end; bars from a state's start to its end.
function spans(events, end) {
  const lanes = [];
  const bars = [];
  const open = new Map();
  let asked = null;
  const failed = new Set();
  const close = (lane, t, kind, words) => {
    const from = open.get(lane);
    open.delete(lane);
    if (from !== undefined) bars.push({ lane, from, to: t, kind, words });
  };
  const seen = { oracle: false, expert: false };
  for (const event of events) {
    const lane = laneOf(event);
    if (lane in seen) seen[lane] = true;
    else if (event.state && !lanes.includes(lane)) lanes.push(lane);
    const state = event.path + '/' + event.state;
    if (event.kind === 'state_start') { open.set(state, event.t); failed.delete(state); }
    if (event.kind === 'failure') { close(state, event.t, 'bad', event.words); failed.add(state); }
    if (event.kind === 'transition') close(state, event.t, 'good', event.words);
    if (event.kind === 'query_opened') asked = event;
    if (asked && ['query_answered', 'query_expired', 'query_cancelled'].includes(event.kind)) {
      bars.push({ lane: 'expert', from: asked.t, to: event.t, kind: 'expert', words: asked.words });
      asked = null;
    }
  }
  for (const [lane, from] of open) bars.push({ lane, from, to: end, kind: 'running', words: lane + ' runs' });
  if (asked) bars.push({ lane: 'expert', from: asked.t, to: end, kind: 'expert waiting', words: asked.words });
  return { lanes: lanes.concat(seen.oracle ? ['oracle'] : [], seen.expert ? ['expert'] : []), bars };
}

function ticks(whole, most) {
  const step = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1800, 3600].find((each) => whole / each <= Math.min(8, most)) || whole / 5;
  const found = [];
  for (let tick = 0; tick <= whole; tick += step) found.push(tick);
  return found;
}
