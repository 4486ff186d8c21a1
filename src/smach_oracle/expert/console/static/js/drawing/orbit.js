// @ts-check
// Looking at something from all sides: one finger or the left button turns, two or the right one
// move, the wheel or a pinch zooms; arrow keys turn, + and - zoom.
import { Gestures } from '../page/gestures.js';
import { vector } from './transforms.js';

const FOCAL = 1.1; // of the height
const FURTHEST = 200; // m
const CLOSEST = 0.05;
const STEEPEST = 1.55; // rad
const TURN = 0.008; // rad for 1 px

export class Orbit {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {() => void} changed there is something new to see
   */
  constructor(canvas, changed) {
    this.canvas = canvas;
    this.changed = changed;
    /** @type {drawing.Vector} */
    this.centre = [0, 0, 0];
    this.distance = 3;
    this.azimuth = -0.5;
    this.elevation = 0.45;
    this.optical = false;
    this.gestures = new Gestures(canvas, { step: 12, closer: 1.18, wheel: 0.0012, end: changed,
      drag: (dx, dy, other) => (other ? this.shift(dx, dy) : this.turn(dx, dy)),
      zoom: (factor) => this.zoom(factor) });
    canvas.addEventListener('contextmenu', (event) => event.preventDefault());
  }

  /**
   * @param {drawing.Vector} centre
   * @param {number} distance m
   * @param {drawing.Looks} looks
   */
  look(centre, distance, { azimuth = -0.5, elevation = 0.45, optical = false }) {
    this.centre = centre;
    this.distance = bounded(CLOSEST, distance, FURTHEST);
    this.azimuth = azimuth;
    this.elevation = elevation;
    this.optical = optical;
    this.changed();
  }

  /**
   * Right, down and ahead on the screen, in the frame of what is seen.
   * @returns {[drawing.Vector, drawing.Vector, drawing.Vector]}
   */
  axes() {
    const [ca, sa] = [Math.cos(this.azimuth), Math.sin(this.azimuth)];
    const [ce, se] = [Math.cos(this.elevation), Math.sin(this.elevation)];
    /**
     * @param {drawing.Vector} axis
     * @returns {drawing.Vector}
     */
    const own = ([x, y, z]) => (this.optical ? [-y, -z, x] : [x, y, z]);
    return [own([sa, -ca, 0]), own([ca * -se, sa * -se, -ce]), own([ca * ce, sa * ce, -se])];
  }

  /**
   * @param {number} width px
   * @param {number} height px
   * @returns {drawing.View}
   */
  view(width, height) {
    const [right, down, ahead] = this.axes();
    const focal = FOCAL * Math.min(height, 1.3 * width);
    const { centre, distance } = this;
    return { right, down, ahead, centre, distance, focal, width, height };
  }

  /**
   * @param {number} dx px
   * @param {number} dy px
   */
  turn(dx, dy) {
    this.azimuth -= dx * TURN;
    this.elevation = bounded(-STEEPEST, this.elevation + dy * TURN, STEEPEST);
    this.changed();
  }

  /**
   * @param {number} dx px
   * @param {number} dy px
   */
  shift(dx, dy) {
    const [right, down] = this.axes();
    const { clientWidth, clientHeight } = this.canvas;
    const step = this.distance / this.view(clientWidth, clientHeight).focal;
    const { centre } = this;
    this.centre = vector((axis) => centre[axis] - step * (dx * right[axis] + dy * down[axis]));
    this.changed();
  }

  /** @param {number} factor above 1: closer */
  zoom(factor) {
    this.distance = bounded(CLOSEST, this.distance / factor, FURTHEST);
    this.changed();
  }

  get moving() { return this.gestures.pressed; }
}

/**
 * @param {number} least
 * @param {number} value
 * @param {number} most
 */
function bounded(least, value, most) { return Math.min(most, Math.max(least, value)); }
