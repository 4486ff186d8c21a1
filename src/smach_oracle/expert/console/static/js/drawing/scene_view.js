// @ts-check
// A scene in 3D to be turned round: layers on a canvas.
import { h, setText } from '../page/dom.js';
import { Orbit } from './orbit.js';
import { Raster } from './raster.js';
import { boxAround, diagonalOf, middleOf } from './transforms.js';

const QUICK_MS = 30; // a scene drawn so quickly is drawn with twice the pixels, to be smooth
const SLOW_MS = 110;

export class SceneView {
  /**
   * @param {string} label
   * @param {() => void} onHome the usual view is wanted
   */
  constructor(label, onHome) {
    this.canvas = h('canvas', { class: 'cloud', tabindex: 0, role: 'img',
      'aria-label': label + '; drag to turn, arrow keys too' });
    this.note = h('p', { class: 'view-note', role: 'status' });
    this.buttons = h('div', { class: 'view-buttons' },
      h('button', { class: 'tool view-home', onclick: onHome }, 'Reset view'));
    this.root = h('div', { class: 'screen scene' }, this.canvas, this.note, this.buttons);
    /** @type {drawing.Layer[]} */
    this.layers = [];
    this.raster = new Raster();
    this.fine = 1; // px of the canvas for one px of the page
    this.slow = false;
    this.scheduled = 0;
    this.tookMs = NaN;
    this.orbit = new Orbit(this.canvas, () => this.schedule());
    this.resized = new ResizeObserver(() => this.schedule());
    this.resized.observe(this.canvas);
    this.say('');
  }

  stop() { this.resized.disconnect(); }

  /** @param {string} text */
  say(text) {
    setText(this.note, text);
  }

  /** @param {(drawing.Layer | null | undefined | false)[]} layers */
  show(layers) {
    this.layers = /** @type {drawing.Layer[]} */ (layers.filter(Boolean));
    this.schedule();
  }

  /**
   * Look at all of some boxes from a usual side.
   * @param {(drawing.Box | null)[]} boxes
   * @param {drawing.Looks & { reach?: number }} looks reach: distance in units of their size
   */
  frame(boxes, { reach = 1.1, ...looks }) {
    const corners = boxes.flatMap((box) => box || []);
    if (!corners.length) return;
    const whole = boxAround(corners);
    this.orbit.look(middleOf(whole), Math.max(0.3, reach * diagonalOf(whole)), looks);
  }

  schedule() {
    if (this.scheduled) return;
    this.scheduled = requestAnimationFrame(() => {
      this.scheduled = 0;
      this.draw();
    });
  }

  draw() {
    const fine = this.orbit.moving ? 1 : this.fine;
    const { canvas } = this;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight]
      .map((each) => Math.round(each * fine));
    const context = canvas.getContext('2d');
    if (!width || !height || !context) return;
    const begun = performance.now();
    if (canvas.width !== width) canvas.width = width;
    if (canvas.height !== height) canvas.height = height;
    const image = context.createImageData(width, height);
    const view = this.orbit.view(width, height);
    const paper = { ratio: fine, ground: groundOf(canvas) };
    this.raster.begin(image);
    for (const layer of this.layers) layer.draw(this.raster, view, paper);
    context.putImageData(image, 0, 0);
    this.note3d();
    if (fine === this.fine) this.measure(performance.now() - begun);
  }

  /** Write beside the canvas what is on it, for tests. */
  note3d() {
    const { layers } = this;
    const triangles = layers.reduce((sum, layer) => sum + (layer.triangles || 0), 0);
    const points = layers.reduce((sum, { points: each }) => sum + (each ? each.length / 3 : 0), 0);
    Object.assign(this.canvas.dataset, { triangles, points });
  }

  /** @param {number} ms that the last drawing took */
  measure(ms) {
    this.tookMs = Number.isNaN(this.tookMs) ? ms : 0.7 * this.tookMs + 0.3 * ms;
    if (this.fine === 1 && this.tookMs < QUICK_MS && !this.slow) {
      this.fine = 2;
      this.schedule();
    } else if (this.fine === 2 && this.tookMs > SLOW_MS) {
      this.fine = 1;
      this.slow = true; // and it stays so: scenes that change their grain are worse
    }
  }
}

/**
 * The colour behind a canvas.
 * @param {HTMLCanvasElement} canvas
 * @returns {drawing.Colour}
 */
function groundOf(canvas) {
  const levels = getComputedStyle(canvas).backgroundColor.match(/[\d.]+/g) || [];
  if (levels.length < 3) return [11, 13, 18];
  return [Number(levels[0]), Number(levels[1]), Number(levels[2])];
}
