// @ts-check
// A robot in a scene: the geometries of its links, at their poses.
import { boxAround, chained, cornersOf, placed } from './transforms.js';

/** @typedef {import('./raster.js').Raster} Raster */

/** @implements {drawing.Layer} */
export class RobotLayer {
  /**
   * @param {drawing.RobotModel} model
   * @param {Float32Array} poses of each link, one after the other
   */
  constructor(model, poses) {
    this.model = model;
    this.poses = poses;
    this.dim = 0; // share of the background in its colours
  }

  get triangles() {
    const { parts, geometries } = this.model;
    return parts.reduce((sum, [, geometry]) => sum + geometries[geometry].triangles.length / 3, 0);
  }

  /** @param {number} link */
  pose(link) { return this.poses.subarray(12 * link, 12 * link + 12); }

  bounds() {
    const { parts, geometries } = this.model;
    if (!parts.length) return null;
    return boxAround(parts.flatMap(([link, geometry, pose]) => {
      const at = chained(this.pose(link), pose);
      return cornersOf(geometries[geometry].box).map((corner) => placed(at, corner));
    }));
  }

  /**
   * @param {Raster} raster
   * @param {drawing.View} view
   * @param {drawing.Paper} paper
   */
  draw(raster, view, { ground }) {
    for (const [link, geometry, pose, colour] of this.model.parts) {
      raster.mesh(view, this.model.geometries[geometry], chained(this.pose(link), pose),
        this.dim ? this.dimmed(colour, ground) : colour);
    }
  }

  /**
   * @param {drawing.Colour} colour
   * @param {drawing.Colour} ground
   * @returns {drawing.Colour}
   */
  dimmed(colour, ground) {
    /** @param {number} i */
    const level = (i) => colour[i] + this.dim * (ground[i] - colour[i]);
    return [level(0), level(1), level(2)];
  }
}
