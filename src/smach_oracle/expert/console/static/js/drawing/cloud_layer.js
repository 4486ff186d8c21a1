// @ts-check
// A point cloud in a scene.
import { placed } from './transforms.js';

/** @typedef {import('./raster.js').Raster} Raster */

const LOOKED_AT = 2000; // points, to find out how large a cloud is

/**
 * Points as the server sends them: positions, then colours.
 * @param {ArrayBuffer} data
 * @param {Pick<server.CloudFacts, 'count' | 'offset' | 'scale'>} facts
 * @returns {drawing.Points}
 */
export function unpacked(data, { count, offset, scale }) {
  const raw = new Uint16Array(data, 0, 3 * count);
  const points = new Float32Array(raw.length);
  for (let i = 0; i < raw.length; i += 1) points[i] = offset[i % 3] + scale[i % 3] * raw[i] / 65535;
  return { points, colours: new Uint8Array(data, raw.byteLength, 3 * count) };
}

/** @implements {drawing.Layer} */
export class CloudLayer {
  /**
   * @param {drawing.Points} cloud its points are changed to where they are placed
   * @param {drawing.Pose | undefined} pose the scene from the cloud; undefined: they are one
   * @param {{ dim?: number, spacing?: number }} looks share of the background in its colours;
   *   size of a point in m
   */
  constructor({ points, colours }, pose, { dim = 0, spacing = 0 } = {}) {
    this.points = points;
    this.colours = colours;
    this.dim = dim;
    this.dimmedFor = '';
    this.dimmedColours = colours;
    if (pose) {
      for (let i = 0; i < points.length; i += 3) {
        points.set(placed(pose, points.subarray(i, i + 3)), i);
      }
    }
    this.box = points.length ? this.inner() : null;
    this.spacing = spacing || this.usualSpacing();
  }

  /**
   * The box without the outermost few points, which may be anywhere.
   * @returns {drawing.Box}
   */
  inner() {
    const step = 3 * Math.ceil(this.points.length / (3 * LOOKED_AT));
    const length = Math.ceil(this.points.length / step);
    const axes = [0, 1, 2].map((axis) => (
      Float32Array.from({ length }, (_, i) => this.points[i * step + axis]).sort()));
    /**
     * @param {number} share
     * @returns {drawing.Vector}
     */
    const at = (share) => {
      const index = Math.round(share * (length - 1));
      return [axes[0][index], axes[1][index], axes[2][index]];
    };
    return [at(0.02), at(0.98)];
  }

  usualSpacing() {
    if (!this.box) return 0.01;
    const [low, high] = this.box;
    return Math.max(...high.map((each, axis) => each - low[axis])) / 130;
  }

  bounds() { return this.box; }

  /**
   * @param {Raster} raster
   * @param {drawing.View} view
   * @param {drawing.Paper} paper
   */
  draw(raster, view, { ratio, ground }) {
    const colours = this.dim ? this.dimmed(ground) : this.colours;
    raster.points(view, this.points, colours, this.spacing, Math.max(1, Math.round(ratio)));
  }

  /** @param {drawing.Colour} ground */
  dimmed(ground) {
    if (String(ground) !== this.dimmedFor) {
      this.dimmedFor = String(ground);
      this.dimmedColours = this.colours.map((level, i) => (
        level + this.dim * (ground[i % 3] - level)));
    }
    return this.dimmedColours;
  }
}
