// @ts-check
// The box around an object in a scene.
import { boxAround, chained, cornersOf, placed, vector } from './transforms.js';

/** @typedef {import('./raster.js').Raster} Raster */

/** @type {drawing.Colour} */
const EDGE = [124, 176, 255];
/** @type {drawing.Colour[]} */
const AXES = [[255, 80, 70], [70, 210, 110], [80, 130, 255]];

/**
 * An upright box with its axes.
 * @implements {drawing.Layer}
 */
export class BoxLayer {
  /**
   * @param {{ position: drawing.Vector, yaw: number, size: drawing.Vector }} box yaw in rad
   * @param {drawing.Pose | undefined} pose the scene from the box's frame; undefined: they are one
   */
  constructor({ position: [x, y, z], yaw, size }, pose) {
    const [c, s] = [Math.cos(yaw), Math.sin(yaw)];
    const own = [c, -s, 0, x, s, c, 0, y, 0, 0, 1, z];
    this.at = pose ? chained(pose, own) : own;
    this.size = size;
  }

  /** @param {drawing.Vector} signs -1 or 1 along each axis */
  corner(signs) { return placed(this.at, vector((axis) => signs[axis] * this.size[axis] / 2)); }

  bounds() {
    return boxAround(cornersOf([[-1, -1, -1], [1, 1, 1]]).map((signs) => this.corner(signs)));
  }

  /**
   * @param {Raster} raster
   * @param {drawing.View} view
   * @param {drawing.Paper} paper
   */
  draw(raster, view, { ratio }) {
    const thick = Math.round(2 * ratio);
    for (let axis = 0; axis < 3; axis += 1) {
      for (const others of [[-1, -1], [-1, 1], [1, -1], [1, 1]]) {
        const [begin, end] = [-1, 1].map((sign) => this.corner(vector((each) => (
          each === axis ? sign : others[each < axis ? each : each - 1]))));
        raster.line(view, begin, end, EDGE, thick, 1.002);
      }
      const tip = vector((each) => (each === axis ? 0.06 + this.size[axis] / 2 : 0));
      raster.line(view, placed(this.at, [0, 0, 0]), placed(this.at, tip), AXES[axis],
        Math.round(2.5 * ratio), 1.5);
    }
  }
}
