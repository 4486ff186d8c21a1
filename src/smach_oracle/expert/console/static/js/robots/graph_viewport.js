// @ts-check
// Which part of a drawing is seen: all of it where that stays readable, else what is active; or
// what a person has moved into view, by mouse, wheel, fingers or keys.
import { Gestures } from '../page/gestures.js';

/** @typedef {{ width: number, height: number }} Size px */
/** @typedef {[x: number, y: number]} Place px */
/** @typedef {{ x: number, y: number, width: number, height: number }} Seen px of the drawing */

export const CLOSER = 1.3;
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
    new Gestures(graph.drawing, { step: -60, closer: CLOSER, wheel: 1 / 400,
      drag: (dx, dy) => this.shift(dx, dy),
      zoom: (factor, at) => this.zoom(factor, at) });
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
   * @param {Place} [at] px of the window: what stays there; else the middle
   */
  zoom(factor, at) {
    const { box, view } = this;
    const [px, py] = at ? [at[0] - box.left, at[1] - box.top] : [box.width / 2, box.height / 2];
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
}
