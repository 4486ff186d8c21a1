// @ts-check
// The canvas over an image, on which a person marks an object.
import { h } from '../page/dom.js';
import { Marking, isBrush } from './marking.js';
import { drawCross, drawMarking } from './marking_drawing.js';
import { MARKING_KEYS, MarkingKeys } from './marking_keys.js';

/** @typedef {import('./marking.js').Tool} Tool */
/** @typedef {import('./perception_panel.js').PerceptionPanel} PerceptionPanel */

const BRUSH = 7; // px of the screen
const THINNEST = 2; // px of the image

export class MarkingCanvas {
  /** @param {PerceptionPanel} panel that it is a part of */
  constructor(panel) {
    this.panel = panel;
    this.marking = new Marking();
    /** @type {number[][]} */
    this.outlines = []; // of what was cut out
    /** @type {Tool} */
    this.tool = 'rectangle';
    this.root = h('canvas', { class: 'drawing', width: 4, height: 3, tabindex: 0,
      role: 'application', 'aria-roledescription': 'drawing', 'aria-label': 'Mark the object here',
      'aria-describedby': 'marking-keys' });
    this.hint = h('p', { class: 'keys-hint', id: 'marking-keys' }, MARKING_KEYS);
    this.keys = new MarkingKeys(this);
    this.root.addEventListener('pointerdown', (event) => this.press(event));
    this.root.addEventListener('pointermove', (event) => this.move(event));
    this.root.addEventListener('pointerup', () => this.end());
    this.root.addEventListener('pointercancel', () => this.cancel());
  }

  /**
   * As large as the image.
   * @param {[width: number, height: number]} size px
   */
  setSize([width, height]) { Object.assign(this.root, { width, height }); }

  /** @param {PointerEvent} event */
  press(event) {
    if (!this.panel.mayDraw || !event.isPrimary || event.button) return;
    event.preventDefault();
    this.root.setPointerCapture(event.pointerId);
    this.begin(this.at(event));
  }

  /** @param {server.Point} point */
  begin(point) {
    const correcting = isBrush(this.tool);
    if (correcting && !this.marking.region) {
      this.panel.refuse();
      return;
    }
    const width = Math.max(THINNEST, Math.round(BRUSH * this.scale));
    this.marking.begin(this.tool, point, width);
    if (!correcting) this.panel.forget();
    this.paint();
  }

  /** @param {PointerEvent} event */
  move(event) {
    if (!this.marking.line) return;
    const passed = event.getCoalescedEvents ? event.getCoalescedEvents() : [];
    for (const each of [...passed, event]) this.marking.move(this.at(each));
    this.paint();
  }

  end() {
    if (this.marking.end()) this.panel.cut();
    this.panel.draw();
  }

  cancel() {
    this.marking.line = null;
    this.panel.draw();
  }

  /** Pixels of the image for one of the screen. */
  get scale() { return this.root.width / (this.root.clientWidth || 1); }

  /**
   * The pixel of the image.
   * @param {PointerEvent} event
   * @returns {server.Point}
   */
  at(event) {
    const { left, top, width, height } = this.root.getBoundingClientRect();
    /**
     * @param {number} share
     * @param {number} size
     */
    const place = (share, size) => Math.round(Math.min(Math.max(share, 0), 1) * (size - 1));
    return [place((event.clientX - left) / width, this.root.width),
      place((event.clientY - top) / height, this.root.height)];
  }

  paint() {
    this.hint.hidden = Boolean(this.keys.cross); // it would cover what is drawn
    const context = this.root.getContext('2d');
    if (!context) return;
    context.clearRect(0, 0, this.root.width, this.root.height);
    drawMarking(context, this.marking, this.outlines, this.scale);
    if (this.keys.cross) drawCross(context, this.keys.cross, this.scale);
  }
}
