// @ts-check
// A trial on a time axis, with a cursor: a lane for each state, one for the oracle, one for the
// expert.
import { h, svg } from '../page/dom.js';
import { duration } from '../page/format.js';
import { redraw } from '../page/redraw.js';
import { MARKS, laneOf, lanesOf, questionBars, stateBars, ticks } from './time_axis.js';

/** @typedef {{ from: number, to: number }} Part of the axis, s since the epoch */
/** @typedef {Pick<import('./trial_replay.js').TrialReplay, 'pick' | 'seek' | 'key'>} Replay */

const LANE = 26; // px high
const NAME = 168; // px wide, at most
const RIGHT = 14; // px that are left free
const TOP = 6;
const AXIS = 24;
const NARROWEST = 50;
const SHORTEST_S = 0.5; // that the axis may show

export class Timeline {
  /** @param {Replay} replay that it is a part of */
  constructor(replay) {
    this.replay = replay;
    this.cursor = h('div', { class: 'cursor-line' });
    this.lanes = h('div', {});
    this.canvas = h('div', { class: 'timeline-canvas' }, this.lanes, this.cursor);
    this.handle = h('div', { class: 'cursor-handle' });
    this.axis = h('div', { class: 'axis' });
    this.slider = h('div', { class: 'cursor-rail', role: 'slider', tabindex: '0',
      'aria-label': 'Time in the trial', 'aria-valuemin': 0,
      onkeydown: (event) => replay.key(event) },
    this.axis, this.handle);
    this.root = h('div', { class: 'timeline' }, this.slider, this.canvas);
    /** @type {server.TrialEvent[]} */
    this.events = [];
    this.end = 0;
    this.width = 0; // px; 0: nothing is drawn
    /** @type {string[]} */
    this.shownLanes = [];
    this.picked = -1; // number of an event
    /** @type {Part | null} */
    this.part = null; // that is shown; null: the whole trial
    /** @type {{ t: number, words: string } | null} */
    this.placed = null; // where the cursor is
    for (const element of [this.slider, this.canvas]) this.listen(element);
    new ResizeObserver(() => this.draw()).observe(this.root);
  }

  /**
   * Press and drag, by mouse, pen or finger; up and down still scrolls the page.
   * @param {HTMLElement} element
   */
  listen(element) {
    let dragged = -1;
    element.addEventListener('pointerdown', (event) => {
      const mark = event.target instanceof Element && event.target.classList.contains('mark');
      if (event.button || mark || this.isOnNames(event)) return;
      dragged = event.pointerId;
      element.setPointerCapture(dragged);
      this.slider.focus({ preventScroll: true });
      event.preventDefault();
      this.seek(event);
    });
    element.addEventListener('pointermove', (event) => {
      if (event.pointerId === dragged) this.seek(event);
    });
    const end = () => { dragged = -1; };
    element.addEventListener('pointerup', end);
    element.addEventListener('pointercancel', end);
  }

  /** @param {PointerEvent} event */
  isOnNames(event) {
    return this.xOf(event) < this.left - 12;
  }

  /**
   * px from the left side.
   * @param {PointerEvent} event
   */
  xOf(event) { return event.clientX - this.root.getBoundingClientRect().left; }

  /** @param {PointerEvent} event */
  seek(event) {
    if (!this.width) return;
    const share = (this.xOf(event) - this.left) / (this.width - RIGHT - this.left);
    this.replay.seek(this.begin + this.whole * Math.min(1, Math.max(0, share)));
  }

  /** px where the axis begins. */
  get left() { return Math.min(NAME, this.width * 0.3); }

  /** When the part that is shown begins. */
  get begin() { return this.part ? this.part.from : this.events[0].t; }

  /** How long it is, s. */
  get whole() { return Math.max((this.part ? this.part.to : this.end) - this.begin, 0.001); }

  /**
   * The cursor to a time.
   * @param {number} t
   * @param {string} words what is there
   */
  place(t, words) {
    this.placed = { t, words };
    if (!this.width) return;
    if (this.part && (t < this.part.from || t > this.part.to)) this.moveTo(t);
    this.root.style.setProperty('--at', this.x(t) + 'px');
    const first = this.events[0].t;
    this.slider.setAttribute('aria-valuemax', (this.end - first).toFixed(2));
    this.slider.setAttribute('aria-valuenow', (t - first).toFixed(2));
    this.slider.setAttribute('aria-valuetext', words);
  }

  /**
   * Show a shorter part, or a longer one. The cursor stays where it is on the screen.
   * @param {number} factor above 1: shorter; 0: the whole trial
   */
  zoom(factor) {
    if (!this.width) return;
    const { begin, whole } = this;
    const first = this.events[0].t;
    const span = factor ? Math.max(whole / factor, SHORTEST_S) : Infinity;
    const at = Math.min(begin + whole, Math.max(begin, this.placed ? this.placed.t : begin));
    const from = Math.max(first, at - span * ((at - begin) / whole));
    this.part = span >= this.end - first ? null : this.within(from, span);
    this.draw();
  }

  /**
   * So much from a time on, as far as there is so much.
   * @param {number} from
   * @param {number} span s
   * @returns {Part}
   */
  within(from, span) {
    const start = Math.max(this.events[0].t, Math.min(from, this.end - span));
    return { from: start, to: start + span };
  }

  /**
   * Another part of the same length, with a time in its middle.
   * @param {number} t
   */
  moveTo(t) {
    if (!this.part) return;
    const span = this.part.to - this.part.from;
    this.part = this.within(t - span / 2, span);
    this.drawPart();
  }

  /**
   * @param {server.TrialEvent[]} events
   * @param {number} end of the axis
   */
  set(events, end) {
    if (events[0]?.t !== this.events[0]?.t) this.part = null; // another trial
    this.events = events;
    this.end = end;
    this.draw();
  }

  /** @param {number} seq */
  pick(seq) {
    this.picked = seq;
    for (const mark of this.root.querySelectorAll('[data-seq]')) {
      mark.classList.toggle('picked', mark.getAttribute('data-seq') === String(seq));
    }
    const event = this.events.find((each) => each.seq === seq);
    const lane = event ? this.shownLanes.indexOf(laneOf(event)) : -1;
    if (lane < 0) return;
    const top = TOP + lane * LANE;
    const { scrollTop, clientHeight } = this.canvas;
    if (top < scrollTop || top + LANE > scrollTop + clientHeight) {
      this.canvas.scrollTop = top - clientHeight / 2;
    }
  }

  draw() {
    this.drawPart();
    if (this.placed) this.place(this.placed.t, this.placed.words);
  }

  drawPart() {
    const width = this.canvas.clientWidth;
    const empty = !this.events.length || width < NARROWEST;
    this.width = empty ? 0 : width;
    this.slider.hidden = this.cursor.hidden = empty;
    if (empty) {
      redraw(this.lanes, h('p', { class: 'empty' }, 'No events.'));
      return;
    }
    this.shownLanes = lanesOf(this.events);
    const shown = ticks(this.whole, Math.max(2, (width - this.left) / 62),
      this.begin - this.events[0].t);
    redraw(this.axis, this.drawAxis(shown));
    redraw(this.lanes, this.drawLanes(shown));
  }

  /**
   * Whether something lies in the part that is shown.
   * @param {number} from
   * @param {number} to
   */
  isShown(from, to) { return !this.part || (to >= this.part.from && from <= this.part.to); }

  /**
   * px of a time.
   * @param {number} t
   */
  x(t) {
    const { left, width, begin, whole } = this;
    return left + (width - RIGHT - left) * Math.min(1, Math.max(0, (t - begin) / whole));
  }

  /**
   * px of a lane's top.
   * @param {string} lane
   */
  y(lane) { return TOP + this.shownLanes.indexOf(lane) * LANE; }

  /** @param {number[]} shown ticks */
  drawAxis(shown) {
    const { width, events: [{ t: begin }] } = this;
    return svg('svg', { width, height: AXIS, viewBox: '0 0 ' + width + ' ' + AXIS,
      'aria-hidden': true }, shown.map((tick) => svg('text', { class: 'tick-text',
      x: Math.min(this.x(begin + tick), width - 26), y: 16 },
    tick < 10 ? Math.round(tick * 100) / 100 + ' s' : duration(tick))));
  }

  /** @param {number[]} shown ticks */
  drawLanes(shown) {
    const { width, left, events: [{ t: begin }] } = this;
    const height = TOP + this.shownLanes.length * LANE + 6;
    this.cursor.style.setProperty('--height', height + 'px');
    const bars = [...stateBars(this.events, this.end), ...questionBars(this.events, this.end)];
    return svg('svg', { width, height, viewBox: '0 0 ' + width + ' ' + height, role: 'img',
      'aria-label': 'Events of the trial over time' },
    shown.map((tick) => {
      const x = this.x(begin + tick);
      return svg('line', { class: 'tick', x1: x, x2: x, y1: 0, y2: height });
    }),
    this.shownLanes.map((lane) => svg('text', { class: 'lane', x: 0, y: this.y(lane) + 16 },
      short(lane, left), svg('title', {}, lane))),
    bars.filter(({ from, to }) => this.isShown(from, to)).map((bar) => this.drawBar(bar)),
    this.events.filter(({ t }) => this.isShown(t, t)).map((event) => this.drawMark(event)));
  }

  /** @param {replay.Bar} bar */
  drawBar({ lane, from, to, kind, words }) {
    const [x, end] = [this.x(from), this.x(to)];
    return svg('rect', { class: 'bar ' + kind, x, y: this.y(lane) + 4, rx: 3, height: LANE - 8,
      width: Math.max(2, end - x) }, svg('title', {}, words));
  }

  /**
   * @param {server.TrialEvent} event
   * @returns {page.Child}
   */
  drawMark(event) {
    const { kind, seq, t, words } = event;
    const looks = MARKS[kind];
    return looks && svg('circle', { key: seq,
      class: 'mark ' + looks + (seq === this.picked ? ' picked' : ''),
      cx: this.x(t), cy: this.y(laneOf(event)) + LANE / 2, r: 4.5, 'data-seq': seq,
      onclick: () => this.replay.pick(seq) }, svg('title', {}, words));
  }
}

/**
 * The name of a lane, as far as there is room.
 * @param {string} lane
 * @param {number} width px
 */
function short(lane, width) {
  const most = Math.floor((width - 8) / 7.7);
  const names = lane.split('/');
  const label = names[names.length - 1];
  return label.length > most ? label.slice(0, most - 1) + '…' : label;
}
