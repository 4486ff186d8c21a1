// What a scene in 3D is made of. Each layer has draw(raster, view, paper), where paper is {ratio: px of the picture for
// one of the page, ground: the background's colour}, and bounds(): [low, high] corners in m, or null where it has none.

const GRID = 3; // m to each side

// A point of one frame in another; `place` is 3 x 4, by rows.
function placed(place, [x, y, z]) {
  return [0, 4, 8].map((row) => place[row] * x + place[row + 1] * y + place[row + 2] * z + place[row + 3]);
}

// 3 x 4, by rows: one after the other.
function chained(one, other) {
  const found = new Float32Array(12);
  for (let row = 0; row < 12; row += 4) {
    for (let column = 0; column < 4; column += 1) {
      let sum = column === 3 ? one[row + 3] : 0;
      for (let k = 0; k < 3; k += 1) sum += one[row + k] * other[4 * k + column];
      found[row + column] = sum;
    }
  }
  return found;
}

// Points as the console sends them: facts {count, offset, scale}, bytes of positions and colours.
export function unpacked(data, facts) {
  const raw = new Uint16Array(data, 0, 3 * facts.count);
  const points = new Float32Array(raw.length);
  for (let i = 0; i < raw.length; i += 1) points[i] = facts.offset[i % 3] + facts.scale[i % 3] * raw[i] / 65535;
  return { points, colours: new Uint8Array(data, raw.byteLength, 3 * facts.count) };
}

export class CloudLayer {
  constructor({ points, colours }, place, { dim = 0, spacing } = {}) {
    Object.assign(this, { points, colours, dim });
    if (place) for (let i = 0; i < points.length; i += 3) points.set(placed(place, points.subarray(i, i + 3)), i);
    const box = this.bounds();
    this.spacing = spacing || (box ? Math.max(...box[1].map((high, axis) => high - box[0][axis])) / 130 : 0.01);
  }

  // Without the outermost few, which may be anywhere.
  bounds() {
    if (!this.points.length) return null;
    if (this.box) return this.box;
    const step = 3 * Math.ceil(this.points.length / 6000);
    const axes = [0, 1, 2].map((axis) => Float32Array.from({ length: Math.ceil(this.points.length / step) }, (_, i) => this.points[i * step + axis]).sort());
    const at = (share) => axes.map((values) => values[Math.round(share * (values.length - 1))]);
    this.box = [at(0.02), at(0.98)];
    return this.box;
  }

  draw(raster, view, { ratio, ground }) {
    raster.points(view, this.points, this.dim ? this.dimmed(ground) : this.colours, this.spacing, Math.max(1, Math.round(ratio)));
  }

  dimmed(ground) {
    if (String(ground) !== this.paleOn) {
      this.paleOn = String(ground);
      this.pale = this.colours.map((level, i) => level + this.dim * (ground[i % 3] - level));
    }
    return this.pale;
  }
}

export class RobotLayer {
  // `poses`: 3 x 4 of each link, by rows, one after the other
  constructor(model, poses) { Object.assign(this, { model, poses }); }

  get triangles() { return this.model.parts.reduce((sum, [, geometry]) => sum + this.model.geometries[geometry].triangles.length / 3, 0); }

  pose(link) { return this.poses.subarray(12 * link, 12 * link + 12); }

  bounds() {
    if (!this.model.parts.length) return null;
    const [low, high] = [[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]];
    for (const [link, geometry, place] of this.model.parts) {
      const at = chained(this.pose(link), place);
      for (const corner of cornersOf(this.model.geometries[geometry].box)) {
        placed(at, corner).forEach((value, axis) => {
          low[axis] = Math.min(low[axis], value);
          high[axis] = Math.max(high[axis], value);
        });
      }
    }
    return [low, high];
  }

  draw(raster, view, { ground }) {
    for (const [link, geometry, place, colour] of this.model.parts) {
      raster.mesh(view, this.model.geometries[geometry], chained(this.pose(link), place), this.dim ? colour.map((level, i) => level + this.dim * (ground[i] - level)) : colour);
    }
  }
}

// The eight corners of a box [low, high].
function cornersOf(box) {
  return [0, 1].flatMap((x) => [0, 1].flatMap((y) => [0, 1].map((z) => [box[x][0], box[y][1], box[z][2]])));
}

// The floor, in squares of half a metre, at a height in m.
export class GridLayer {
  constructor(floor) { this.floor = floor; }

  bounds() { return null; }

  draw(raster, view, { ground, ratio }) {
    const dark = ground[0] + ground[1] + ground[2] < 380;
    for (let at = -GRID; at <= GRID; at += 0.5) {
      const colour = ground.map((level) => level + (dark ? 1 : -1) * (at === 0 ? 46 : 22));
      const thick = Math.max(1, Math.round(ratio * 0.7));
      raster.line(view, [at, -GRID, this.floor], [at, GRID, this.floor], colour, thick, 0.999);
      raster.line(view, [-GRID, at, this.floor], [GRID, at, this.floor], colour, thick, 0.999);
    }
  }
}

// An upright box {position, yaw, size} with its axes, at a place (null: as it is).
export class BoxLayer {
  constructor({ position, yaw, size }, place) {
    const [c, s] = [Math.cos(yaw), Math.sin(yaw)];
    const own = [c, -s, 0, position[0], s, c, 0, position[1], 0, 0, 1, position[2]];
    this.at = place ? chained(place, own) : own;
    this.size = size;
  }

  corner(signs) { return placed(this.at, signs.map((sign, axis) => sign * this.size[axis] / 2)); }

  bounds() {
    const corners = cornersOf([[-1, -1, -1], [1, 1, 1]]).map((signs) => this.corner(signs));
    return [Math.min, Math.max].map((most) => [0, 1, 2].map((axis) => most(...corners.map((each) => each[axis]))));
  }

  draw(raster, view, { ratio }) {
    const thick = Math.round(2 * ratio);
    for (let axis = 0; axis < 3; axis += 1) {
      for (const [one, other] of [[-1, -1], [-1, 1], [1, -1], [1, 1]]) {
        const signs = (end) => { const found = [one, other]; found.splice(axis, 0, end); return found; };
        raster.line(view, this.corner(signs(-1)), this.corner(signs(1)), [124, 176, 255], thick, 1.002);
      }
      const tip = [0, 0, 0];
      tip[axis] = 0.06 + this.size[axis] / 2;
      raster.line(view, placed(this.at, [0, 0, 0]), placed(this.at, tip), [[255, 80, 70], [70, 210, 110], [80, 130, 255]][axis], Math.round(2.5 * ratio), 1.5);
    }
  }
}
