// A scene in 3D to be turned round: layers on a canvas.
import { h, setText } from './dom.js';
import { Orbit } from './orbit.js';
import { Raster } from './raster.js';

const QUICK_MS = 30; // a picture that is drawn so quickly is drawn with twice the pixels, to be smooth
const SLOW_MS = 110;

export class SceneView {
  constructor(label, onHome) {
    this.canvas = h('canvas', { class: 'cloud', tabindex: 0, role: 'img', 'aria-label': label + '; drag to turn, arrow keys too' });
    this.note = h('p', { class: 'view-note', role: 'status' });
    this.buttons = h('div', { class: 'view-buttons' }, h('button', { class: 'tool view-home', onclick: onHome }, 'Reset view'));
    this.root = h('div', { class: 'screen scene' }, this.canvas, this.note, this.buttons);
    this.layers = [];
    this.raster = new Raster();
    this.fine = 1;
    this.orbit = new Orbit(this.canvas, () => this.schedule());
    this.resized = new ResizeObserver(() => this.schedule());
    this.resized.observe(this.canvas);
    this.say('');
  }

  stop() { this.resized.disconnect(); }

  say(text) {
    setText(this.note, text);
    this.note.hidden = !text;
  }

  show(layers) {
    this.layers = layers.filter(Boolean);
    this.schedule();
  }

  // Look at all of the layers given, from a usual side; `reach`: distance in units of their size.
  frame(layers, { reach = 1.1, ...looks } = {}) {
    const boxes = layers.filter(Boolean).map((layer) => layer.bounds()).filter(Boolean);
    if (!boxes.length) return;
    const [low, high] = [0, 1].map((end) => [0, 1, 2].map((axis) => Math[end ? 'max' : 'min'](...boxes.map((box) => box[end][axis]))));
    const size = Math.hypot(...high.map((each, axis) => each - low[axis]));
    this.orbit.look(low.map((each, axis) => (each + high[axis]) / 2), Math.max(0.3, reach * size), looks);
  }

  schedule() {
    if (this.scheduled) return;
    this.scheduled = requestAnimationFrame(() => { this.scheduled = 0; this.draw(); });
  }

  draw() {
    const fine = this.orbit.moving ? 1 : this.fine;
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight].map((each) => Math.round(each * fine));
    if (!width || !height) return;
    const begun = performance.now();
    if (this.canvas.width !== width || this.canvas.height !== height) Object.assign(this.canvas, { width, height });
    const context = this.canvas.getContext('2d');
    const image = context.createImageData(width, height);
    const view = this.orbit.view(width, height);
    const paper = { ratio: fine, ground: groundOf(this.canvas) };
    this.raster.begin(image);
    for (const layer of this.layers) layer.draw(this.raster, view, paper);
    context.putImageData(image, 0, 0);
    this.tell();
    if (fine === this.fine) this.measure(performance.now() - begun);
  }

  // What is on the screen, for whoever wants to know.
  tell() {
    const sum = (what) => this.layers.reduce((total, layer) => total + (layer[what] || 0), 0);
    Object.assign(this.canvas.dataset, { triangles: sum('triangles'), points: this.layers.reduce((total, layer) => total + (layer.points ? layer.points.length / 3 : 0), 0) });
  }

  measure(ms) {
    this.took = this.took === undefined ? ms : 0.7 * this.took + 0.3 * ms;
    if (this.fine === 1 && this.took < QUICK_MS && !this.slow) {
      this.fine = 2;
      this.schedule();
    } else if (this.fine === 2 && this.took > SLOW_MS) {
      [this.fine, this.slow] = [1, true]; // and it stays so: pictures that change their grain are worse
    }
  }
}

function groundOf(canvas) {
  const told = getComputedStyle(canvas).backgroundColor.match(/[\d.]+/g) || [];
  return told.length >= 3 ? told.slice(0, 3).map(Number) : [11, 13, 18];
}
