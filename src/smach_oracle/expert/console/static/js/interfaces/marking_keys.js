// @ts-check
// Marking by keyboard: the arrow keys move a cross over the image, Enter or Space begins and ends
// what is drawn, Escape takes the line back.
import { announce, modified } from '../page/dom.js';

/** @typedef {import('./marking_canvas.js').MarkingCanvas} MarkingCanvas */

export const MARKING_KEYS = 'Arrow keys move the cross (with Shift by one pixel), Enter begins and '
  + 'ends what is drawn, Escape takes the line back.';
const STEP = 10; // px of the screen
const QUIET_MS = 400; // without a key: then the cross's place is said
/** @type {{ [key: string]: server.Point | undefined }} */
const STEPS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

export class MarkingKeys {
  /** @param {MarkingCanvas} canvas */
  constructor(canvas) {
    this.canvas = canvas;
    /** @type {server.Point | null} */
    this.cross = null; // null: it is not shown
    this.timer = 0;
    canvas.root.addEventListener('keydown', (event) => this.key(event));
    canvas.root.addEventListener('pointerdown', () => this.hide());
    canvas.root.addEventListener('blur', () => this.leave());
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    const step = STEPS[event.key];
    const sets = event.key === 'Enter' || event.key === ' ';
    // also where a new image has just dropped the line: Escape would leave the question then
    const takesBack = event.key === 'Escape' && (this.cross || this.canvas.marking.line);
    if (modified(event) || !(step || sets || takesBack) || !this.canvas.panel.mayDraw) return;
    event.preventDefault();
    event.stopPropagation(); // these keys mean something else elsewhere on the page
    if (step) this.step(step, event.shiftKey);
    else if (takesBack) this.takeBack();
    else if (!event.repeat) this.set();
  }

  /** Where the cross is: at first in the middle. */
  get place() {
    const { width, height } = this.canvas.root;
    const [x, y] = this.cross || [width / 2, height / 2];
    return /** @type {server.Point} */ ([within(x, width), within(y, height)]);
  }

  /**
   * @param {server.Point} step
   * @param {boolean} finely
   */
  step([dx, dy], finely) {
    const by = finely ? 1 : Math.max(1, Math.round(STEP * this.canvas.scale));
    const [x, y] = this.place;
    this.cross = [x + dx * by, y + dy * by];
    this.cross = this.place;
    if (this.canvas.marking.line) this.canvas.marking.move(this.cross);
    this.canvas.paint();
    clearTimeout(this.timer);
    this.timer = setTimeout(() => announce(this.words()), QUIET_MS);
  }

  /** Begin what is drawn at the cross, or end it there. */
  set() {
    this.cross = this.place;
    if (this.canvas.marking.line) this.canvas.end();
    else this.canvas.begin(this.cross);
    this.canvas.paint();
    announce((this.canvas.marking.line ? 'It begins at ' : 'It ends at ') + this.words());
  }

  /** Take the line back, or the cross where there is no line. */
  takeBack() {
    if (this.canvas.marking.line) this.canvas.cancel();
    else this.hide();
  }

  words() {
    const [x, y] = this.place;
    const { width, height } = this.canvas.root;
    return x + ', ' + y + ' of ' + width + ' by ' + height;
  }

  hide() {
    clearTimeout(this.timer);
    this.cross = null;
    this.canvas.paint();
  }

  /** The focus goes: what was begun by keys is not ended by them any more. */
  leave() {
    if (this.cross && this.canvas.marking.line) this.canvas.cancel();
    this.hide();
  }
}

/**
 * @param {number} value
 * @param {number} size px
 */
function within(value, size) { return Math.round(Math.min(Math.max(value, 0), size - 1)); }
