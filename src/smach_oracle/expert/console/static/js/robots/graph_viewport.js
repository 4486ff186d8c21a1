// @ts-check
// Which part of a drawing is seen: all of it where that stays readable, else what is active; or
// what a person has moved into view, by mouse, wheel or fingers.

/** @typedef {{ width: number, height: number }} Size px */
/** @typedef {[x: number, y: number]} Place px */
/** @typedef {{ x: number, y: number, width: number, height: number }} Seen px of the drawing */

const MARGIN = 24; // px
const FOOT = 52; // px below the drawing, where the buttons are
const SMALLEST_READABLE = 0.55;
const LARGEST_FIT = 1.15;
const SMALLEST = 0.08;
const LARGEST = 3;

export class GraphViewport {
  /** @param {import('./graph_view.js').GraphView} graph that it is the view of */
  constructor(graph) {
    this.graph = graph;
    this.size = { width: 1, height: 1, rail: 0 };
    this.view = { x: 0, y: 0, scale: 1 };
    this.follow = true;
    this.fitted = false;
    /** @type {Map<number, PointerEvent>} */
    this.pointers = new Map();
    this.spread = 0; // px between two fingers
    this.listen();
    new ResizeObserver(() => this.place()).observe(graph.root);
  }

  get box() { return this.graph.root.getBoundingClientRect(); }

  /** @param {boolean} on */
  setFollow(on) {
    this.follow = on;
    this.graph.followButton.setAttribute('aria-pressed', String(on));
    if (on) this.place();
  }

  /** As a person wants all of it. */
  fitAll() {
    this.setFollow(false);
    this.fitted = true;
    this.fit();
  }

  place() {
    if (!this.box.width) return;
    if (this.follow || this.fitted) this.fit();
    else this.apply();
    if (this.follow && this.view.scale < SMALLEST_READABLE) this.showFocus();
  }

  showFocus() {
    const { box, size: { width, height } } = this;
    const room = box.width - 2 * MARGIN;
    const scale = Math.max(SMALLEST_READABLE, Math.min(1, room / width));
    const [x, y] = this.graph.focusPlace;
    const [seenWidth, seenHeight] = [box.width / scale, box.height / scale];
    this.view = { scale,
      x: width * scale > room ? x - seenWidth / 2 : (width - seenWidth) / 2,
      y: Math.max(-MARGIN, Math.min(y - seenHeight / 2, height + FOOT / scale - seenHeight)) };
    this.apply();
  }

  fit() {
    const { box, size: { width, height } } = this;
    const scale = Math.min(LARGEST_FIT, (box.width - 2 * MARGIN) / width,
      (box.height - MARGIN - FOOT) / height);
    this.view = { scale, x: (width - box.width / scale) / 2,
      y: (height - (box.height + MARGIN - FOOT) / scale) / 2 };
    this.apply();
  }

  apply() {
    const { box } = this;
    const { x, y, scale } = this.view;
    const [width, height] = [box.width / scale, box.height / scale];
    this.graph.drawing.setAttribute('viewBox', [x, y, width, height].join(' '));
    this.graph.map.show({ x, y, width, height }, this.size);
  }

  /**
   * As a person wants it: a place in the middle, large enough to be read.
   * @param {Place} place of the drawing
   */
  showMiddle([x, y]) {
    const { box } = this;
    this.leave();
    const scale = Math.max(SMALLEST_READABLE, this.view.scale);
    this.view = { scale, x: x - box.width / scale / 2, y: y - box.height / scale / 2 };
    this.apply();
  }

  /**
   * @param {number} factor
   * @param {Place} [at] px in the frame: what stays there; else its middle
   */
  zoom(factor, at) {
    const { box, view } = this;
    const [px, py] = at || [box.width / 2, box.height / 2];
    const scale = Math.min(LARGEST, Math.max(SMALLEST, view.scale * factor));
    this.leave();
    this.view = { scale, x: this.view.x + px / this.view.scale - px / scale,
      y: this.view.y + py / this.view.scale - py / scale };
    this.apply();
  }

  /** A person moves it: it follows nothing any more. */
  leave() {
    this.setFollow(false);
    this.fitted = false;
  }

  listen() {
    const { graph: { drawing }, pointers } = this;
    drawing.addEventListener('wheel', (event) => {
      event.preventDefault();
      this.zoom(Math.exp(-event.deltaY / 400), this.inFrame(event.clientX, event.clientY));
    }, { passive: false });
    drawing.addEventListener('pointerdown', (event) => {
      if (!pointers.size) this.listenWhilePressed();
      pointers.set(event.pointerId, event);
      this.spread = 0;
    });
  }

  /** To the window, and no longer: it would keep every drawing that there ever was. */
  listenWhilePressed() {
    const off = new AbortController();
    const { signal } = off;
    window.addEventListener('pointermove', (event) => this.move(event), { signal });
    /** @param {PointerEvent} event */
    const end = (event) => {
      this.pointers.delete(event.pointerId);
      this.spread = 0;
      if (!this.pointers.size) off.abort();
    };
    window.addEventListener('pointerup', end, { signal });
    window.addEventListener('pointercancel', end, { signal });
  }

  /**
   * px in the frame.
   * @param {number} x
   * @param {number} y
   * @returns {Place}
   */
  inFrame(x, y) {
    const { box } = this;
    return [x - box.left, y - box.top];
  }

  /** @param {PointerEvent} event */
  move(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    this.pointers.set(event.pointerId, event);
    const fingers = [...this.pointers.values()];
    const [dx, dy] = [event.clientX - before.clientX, event.clientY - before.clientY];
    if (fingers.length === 1) this.shift(dx, dy);
    else if (fingers.length === 2) this.pinch(fingers[0], fingers[1]);
  }

  /**
   * @param {number} dx px
   * @param {number} dy px
   */
  shift(dx, dy) {
    if (this.follow && Math.abs(dx) + Math.abs(dy) < 2) return;
    this.leave();
    this.view.x -= dx / this.view.scale;
    this.view.y -= dy / this.view.scale;
    this.apply();
  }

  /**
   * @param {PointerEvent} one
   * @param {PointerEvent} other
   */
  pinch(one, other) {
    const spread = Math.hypot(one.clientX - other.clientX, one.clientY - other.clientY);
    const [x, y] = [(one.clientX + other.clientX) / 2, (one.clientY + other.clientY) / 2];
    if (this.spread) this.zoom(spread / this.spread, this.inFrame(x, y));
    this.spread = spread;
  }
}
