// A point cloud, live, to be turned round: one finger or the left button turns, two or the right one move, the wheel
// or a pinch zooms. Points are drawn one by one with a depth of their own; that needs nothing of the graphics card.
import { h, setText } from './dom.js';
import { FrameFeed, numberOf } from './frame_feed.js';

const FOCAL = 1.1; // of the height
const NEAREST = 0.02;

export class CloudView {
  constructor(app, topic, type) {
    this.canvas = h('canvas', { class: 'cloud', tabindex: 0, role: 'img', 'aria-label': 'Point cloud of ' + topic + '; drag to turn, arrow keys too' });
    this.note = h('p', { class: 'view-note', role: 'status' }, 'Waiting for the first cloud…');
    this.count = h('span', { class: 'dim number' });
    this.root = h('figure', { class: 'view cloud-view', 'data-topic': topic },
      h('div', { class: 'screen' }, this.canvas, this.note, h('button', { class: 'tool view-home', onclick: () => this.home() }, 'Reset view')),
      h('figcaption', { class: 'row' }, h('span', { class: 'ellipsis' }, topic), h('span', { class: 'spacer' }), this.count));
    this.pointers = new Map();
    for (const [name, handler] of [['pointerdown', 'down'], ['pointermove', 'move'], ['pointerup', 'up'], ['pointercancel', 'up'], ['wheel', 'wheel'], ['keydown', 'key']]) {
      this.canvas.addEventListener(name, (event) => this[handler](event), { passive: false });
    }
    this.canvas.addEventListener('contextmenu', (event) => event.preventDefault());
    this.resized = new ResizeObserver(() => this.draw());
    this.resized.observe(this.canvas);
    this.feed = new FrameFeed(app, () => numberOf(app, topic, type), this.root, { every: 150, take: (answer, facts) => this.take(answer, facts), say: (text) => this.say(text) });
  }

  stop() {
    this.feed.stop();
    this.resized.disconnect();
  }

  say(text) {
    setText(this.note, text);
    this.note.hidden = !text;
  }

  async take(answer, facts) {
    const data = await answer.arrayBuffer();
    const raw = new Uint16Array(data, 0, 3 * facts.count);
    const points = new Float32Array(raw.length);
    for (let i = 0; i < raw.length; i += 1) points[i] = facts.offset[i % 3] + facts.scale[i % 3] * raw[i] / 65535;
    const first = !this.points;
    this.points = points;
    this.colours = new Uint8Array(data, raw.byteLength, 3 * facts.count);
    this.facts = facts;
    setText(this.count, facts.count < facts.of ? facts.count + ' of ' + facts.of + ' points' : facts.count + ' points');
    if (first) this.home();
    else this.draw();
  }

  // As the sensor sees it: optical frames look along z with y down, others along x with z up.
  home() {
    const { offset, scale, frame } = this.facts || { offset: [0, 0, 0], scale: [1, 1, 1], frame: '' };
    this.optical = /optical|^$/.test(frame);
    this.centre = offset.map((low, axis) => low + scale[axis] / 2);
    this.distance = Math.max(0.3, 1.1 * Math.hypot(...scale));
    [this.azimuth, this.elevation] = [-0.5, 0.45];
    this.draw();
  }

  // Rows: right, down and ahead on the screen, in the cloud's frame.
  axes() {
    const [ca, sa, ce, se] = [Math.cos(this.azimuth), Math.sin(this.azimuth), Math.cos(this.elevation), Math.sin(this.elevation)];
    const level = [[sa, -ca, 0], [ca * -se, sa * -se, -ce], [ca * ce, sa * ce, -se]]; // z up, looking along x
    return this.optical ? level.map(([x, y, z]) => [-y, -z, x]) : level;
  }

  schedule() {
    if (this.scheduled) return;
    this.scheduled = requestAnimationFrame(() => { this.scheduled = 0; this.draw(); });
  }

  draw() {
    const width = Math.round(this.canvas.clientWidth);
    const height = Math.round(this.canvas.clientHeight);
    if (!this.points || !width || !height) return;
    if (this.canvas.width !== width || this.canvas.height !== height) Object.assign(this.canvas, { width, height });
    const context = this.canvas.getContext('2d');
    const image = context.createImageData(width, height);
    this.plot(new Uint32Array(image.data.buffer), new Float32Array(width * height).fill(Infinity), width, height);
    context.putImageData(image, 0, 0);
  }

  plot(pixels, depths, width, height) {
    const [right, down, ahead] = this.axes();
    const { points, colours, centre, distance } = this;
    const focal = FOCAL * height;
    const size = this.facts.scale.reduce((most, each) => Math.max(most, each), 0) / 110;
    for (let i = 0; i < points.length; i += 3) {
      const [x, y, z] = [points[i] - centre[0], points[i + 1] - centre[1], points[i + 2] - centre[2]];
      const depth = x * ahead[0] + y * ahead[1] + z * ahead[2] + distance;
      if (depth < NEAREST) continue;
      const u = Math.round(width / 2 + focal * (x * right[0] + y * right[1] + z * right[2]) / depth);
      const v = Math.round(height / 2 + focal * (x * down[0] + y * down[1] + z * down[2]) / depth);
      const side = Math.min(6, Math.max(1, Math.round(focal * size / depth)));
      const colour = 0xff000000 | colours[i + 2] << 16 | colours[i + 1] << 8 | colours[i];
      for (let row = Math.max(0, v); row < Math.min(height, v + side); row += 1) {
        for (let column = Math.max(0, u); column < Math.min(width, u + side); column += 1) {
          const at = row * width + column;
          if (depth < depths[at]) {
            depths[at] = depth;
            pixels[at] = colour;
          }
        }
      }
    }
  }

  turn(dx, dy) {
    this.azimuth -= dx * 0.008;
    this.elevation = Math.min(1.55, Math.max(-1.55, this.elevation + dy * 0.008));
    this.schedule();
  }

  shift(dx, dy) {
    const [right, down] = this.axes();
    const step = this.distance / (FOCAL * this.canvas.clientHeight);
    this.centre = this.centre.map((each, axis) => each - step * (dx * right[axis] + dy * down[axis]));
    this.schedule();
  }

  zoom(factor) {
    this.distance = Math.min(200, Math.max(0.05, this.distance * factor));
    this.schedule();
  }

  down(event) {
    this.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, event);
  }

  move(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before || !this.points) return;
    const [dx, dy] = [event.clientX - before.clientX, event.clientY - before.clientY];
    const other = [...this.pointers.values()].find((each) => each.pointerId !== event.pointerId);
    this.pointers.set(event.pointerId, event);
    if (other) {
      const span = (each) => Math.hypot(each.clientX - other.clientX, each.clientY - other.clientY) || 1;
      this.zoom(span(before) / span(event));
      this.shift(dx / 2, dy / 2);
    } else if (event.buttons & 6 || event.shiftKey) this.shift(dx, dy);
    else this.turn(dx, dy);
  }

  up(event) { this.pointers.delete(event.pointerId); }

  wheel(event) {
    event.preventDefault();
    if (this.points) this.zoom(Math.exp(event.deltaY * 0.0012));
  }

  key(event) {
    const step = { ArrowLeft: [-12, 0], ArrowRight: [12, 0], ArrowUp: [0, -12], ArrowDown: [0, 12] }[event.key];
    if (!this.points || !(step || '+-'.includes(event.key))) return;
    event.preventDefault();
    event.stopPropagation();
    if (step) this.turn(...step);
    else this.zoom(event.key === '+' ? 0.85 : 1.18);
  }
}
