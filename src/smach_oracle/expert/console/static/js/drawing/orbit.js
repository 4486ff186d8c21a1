// Looking at something from all sides: one finger or the left button turns, two or the right one move, the wheel or a
// pinch zooms; arrow keys turn, + and - zoom.

const FOCAL = 1.1; // of the height
const FURTHEST = 200; // m
const CLOSEST = 0.05;

export class Orbit {
  // `changed()` is called when there is something new to see.
  constructor(canvas, changed) {
    Object.assign(this, { canvas, changed, centre: [0, 0, 0], distance: 3, azimuth: -0.5, elevation: 0.45, optical: false });
    this.pointers = new Map();
    for (const [name, handler] of [['pointerdown', 'down'], ['pointermove', 'move'], ['pointerup', 'up'], ['pointercancel', 'up'], ['wheel', 'wheel'], ['keydown', 'key']]) {
      canvas.addEventListener(name, (event) => this[handler](event), { passive: false });
    }
    canvas.addEventListener('contextmenu', (event) => event.preventDefault());
  }

  // `optical`: the frame has z ahead and y down, as cameras do; others have z up.
  look(centre, distance, { azimuth = -0.5, elevation = 0.45, optical = false } = {}) {
    Object.assign(this, { centre, distance: Math.min(FURTHEST, Math.max(CLOSEST, distance)), azimuth, elevation, optical });
    this.changed();
  }

  // Rows: right, down and ahead on the screen, in the frame of what is seen.
  axes() {
    const [ca, sa, ce, se] = [Math.cos(this.azimuth), Math.sin(this.azimuth), Math.cos(this.elevation), Math.sin(this.elevation)];
    const level = [[sa, -ca, 0], [ca * -se, sa * -se, -ce], [ca * ce, sa * ce, -se]];
    return this.optical ? level.map(([x, y, z]) => [-y, -z, x]) : level;
  }

  view(width, height) {
    const [right, down, ahead] = this.axes();
    return { right, down, ahead, centre: this.centre, distance: this.distance, focal: FOCAL * Math.min(height, 1.3 * width), width, height };
  }

  turn(dx, dy) {
    this.azimuth -= dx * 0.008;
    this.elevation = Math.min(1.55, Math.max(-1.55, this.elevation + dy * 0.008));
    this.changed();
  }

  shift(dx, dy) {
    const [right, down] = this.axes();
    const step = this.distance / this.view(this.canvas.clientWidth, this.canvas.clientHeight).focal;
    this.centre = this.centre.map((each, axis) => each - step * (dx * right[axis] + dy * down[axis]));
    this.changed();
  }

  zoom(factor) {
    this.distance = Math.min(FURTHEST, Math.max(CLOSEST, this.distance * factor));
    this.changed();
  }

  down(event) {
    this.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, event);
  }

  move(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
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

  up(event) {
    this.pointers.delete(event.pointerId);
    this.changed();
  }

  get moving() { return this.pointers.size > 0; }

  wheel(event) {
    event.preventDefault();
    this.zoom(Math.exp(event.deltaY * 0.0012));
  }

  key(event) {
    const step = { ArrowLeft: [-12, 0], ArrowRight: [12, 0], ArrowUp: [0, -12], ArrowDown: [0, 12] }[event.key];
    if (!step && !'+-'.includes(event.key)) return;
    event.preventDefault();
    event.stopPropagation();
    if (step) this.turn(...step);
    else this.zoom(event.key === '+' ? 0.85 : 1.18);
  }
}
