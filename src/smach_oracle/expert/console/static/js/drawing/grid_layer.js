// @ts-check
// The floor of a scene.
import { vector } from './transforms.js';

/** @typedef {import('./raster.js').Raster} Raster */

const GRID = 3; // m to each side
const DARK = 380; // sum of a colour: below it the lines are lighter than the ground

/**
 * In squares of half a metre.
 * @implements {drawing.Layer}
 */
export class GridLayer {
  /** @param {number} floor its height, m */
  constructor(floor) { this.floor = floor; }

  bounds() { return null; }

  /**
   * @param {Raster} raster
   * @param {drawing.View} view
   * @param {drawing.Paper} paper
   */
  draw(raster, view, { ground, ratio }) {
    const sign = ground[0] + ground[1] + ground[2] < DARK ? 1 : -1;
    const thick = Math.max(1, Math.round(ratio * 0.7));
    for (let at = -GRID; at <= GRID; at += 0.5) {
      const colour = vector((i) => ground[i] + sign * (at === 0 ? 46 : 22));
      raster.line(view, [at, -GRID, this.floor], [at, GRID, this.floor], colour, thick, 0.999);
      raster.line(view, [-GRID, at, this.floor], [GRID, at, this.floor], colour, thick, 0.999);
    }
  }
}
