// @ts-check
// Draws points, triangles and lines in 3D into pixels, each with a depth of its own; needs nothing
// of the graphics card.

const NEAREST = 0.02; // m
const LIGHT = [-0.32, -0.64, -0.7]; // from the left, above, and the viewer
const MOST_STEPS = 4000; // px along a line

export class Raster {
  constructor() {
    this.width = 0;
    this.height = 0;
    this.pixels = new Uint32Array(0);
    this.near = new Float32Array(0); // 1 / depth of what is drawn at a pixel
    this.projected = new Float32Array(0); // of a mesh's corners: x, y, z at the camera, u, v, 1 / z
  }

  /**
   * Begin an empty image.
   * @param {ImageData} image
   */
  begin(image) {
    const size = image.width * image.height;
    this.pixels = new Uint32Array(image.data.buffer);
    if (this.near.length !== size) this.near = new Float32Array(size);
    else this.near.fill(0);
    [this.width, this.height] = [image.width, image.height];
  }

  /**
   * Squares.
   * @param {drawing.View} view
   * @param {Float32Array} points x, y, z, ...
   * @param {Uint8Array} colours red, green, blue, ...
   * @param {number} size of a square, m
   * @param {number} least size of a square, px
   */
  points(view, points, colours, size, least) {
    const { right, down, ahead, centre, distance, focal } = view;
    const { width, height } = this;
    for (let i = 0; i < points.length; i += 3) {
      const x = points[i] - centre[0];
      const y = points[i + 1] - centre[1];
      const z = points[i + 2] - centre[2];
      const depth = x * ahead[0] + y * ahead[1] + z * ahead[2] + distance;
      if (depth < NEAREST) continue;
      const side = Math.min(6 * least, Math.max(least, Math.round(focal * size / depth)));
      const across = focal * (x * right[0] + y * right[1] + z * right[2]) / depth;
      const along = focal * (x * down[0] + y * down[1] + z * down[2]) / depth;
      const u = Math.round(width / 2 + across - side / 2);
      const v = Math.round(height / 2 + along - side / 2);
      this.square(u, v, side, 1 / depth, packed(colours[i], colours[i + 1], colours[i + 2]));
    }
  }

  /**
   * @param {number} u px: its left side
   * @param {number} v px: its upper side
   * @param {number} side px
   * @param {number} inverse 1 / depth
   * @param {number} colour packed
   */
  square(u, v, side, inverse, colour) {
    const { width, height, near, pixels } = this;
    const [left, right] = [Math.max(0, u), Math.min(width, u + side)];
    const bottom = Math.min(height, v + side);
    for (let row = Math.max(0, v); row < bottom; row += 1) {
      for (let at = row * width + left, end = row * width + right; at < end; at += 1) {
        if (inverse > near[at]) {
          near[at] = inverse;
          pixels[at] = colour;
        }
      }
    }
  }

  /**
   * @param {drawing.View} view
   * @param {drawing.Geometry} geometry
   * @param {drawing.Pose} pose the scene from the geometry
   * @param {drawing.Colour} colour
   */
  mesh(view, { corners, triangles }, pose, colour) {
    this.project(view, corners, composed(view, pose));
    for (let i = 0; i < triangles.length; i += 3) {
      this.triangle(6 * triangles[i], 6 * triangles[i + 1], 6 * triangles[i + 2], colour);
    }
  }

  /**
   * @param {drawing.View} view
   * @param {Float32Array} corners
   * @param {Float32Array} camera the camera from the corners
   */
  project(view, corners, camera) {
    const count = corners.length / 3;
    if (this.projected.length < 6 * count) this.projected = new Float32Array(6 * count);
    const found = this.projected;
    for (let i = 0, at = 0; i < corners.length; i += 3, at += 6) {
      const [x, y, z] = [corners[i], corners[i + 1], corners[i + 2]];
      const depth = camera[8] * x + camera[9] * y + camera[10] * z + camera[11];
      found[at] = camera[0] * x + camera[1] * y + camera[2] * z + camera[3];
      found[at + 1] = camera[4] * x + camera[5] * y + camera[6] * z + camera[7];
      found[at + 2] = depth;
      found[at + 3] = this.width / 2 + view.focal * found[at] / depth;
      found[at + 4] = this.height / 2 + view.focal * found[at + 1] / depth;
      found[at + 5] = 1 / depth;
    }
  }

  /**
   * @param {number} a places of its corners in `projected`
   * @param {number} b
   * @param {number} c
   * @param {drawing.Colour} colour
   */
  triangle(a, b, c, colour) {
    const s = this.projected;
    if (s[a + 2] < NEAREST || s[b + 2] < NEAREST || s[c + 2] < NEAREST) return;
    const { width, height, near, pixels } = this;
    const [ua, va, ub, vb, uc, vc] = [s[a + 3], s[a + 4], s[b + 3], s[b + 4], s[c + 3], s[c + 4]];
    const left = Math.max(0, Math.ceil(Math.min(ua, ub, uc) - 0.5));
    const last = Math.min(width - 1, Math.floor(Math.max(ua, ub, uc) - 0.5));
    const top = Math.max(0, Math.ceil(Math.min(va, vb, vc) - 0.5));
    const bottom = Math.min(height - 1, Math.floor(Math.max(va, vb, vc) - 0.5));
    const area = (ub - ua) * (vc - va) - (uc - ua) * (vb - va);
    if (left > last || top > bottom || !area) return;
    const drawn = lit(s, a, b, c, colour);
    // shares of b and c, and with them 1 / z, change evenly over the screen
    const [bx, by] = [(vc - va) / area, (ua - uc) / area];
    const [cx, cy] = [(va - vb) / area, (ub - ua) / area];
    const [inverse, ofB, ofC] = [s[a + 5], s[b + 5] - s[a + 5], s[c + 5] - s[a + 5]];
    for (let row = top; row <= bottom; row += 1) {
      let shareB = (left + 0.5 - ua) * bx + (row + 0.5 - va) * by;
      let shareC = (left + 0.5 - ua) * cx + (row + 0.5 - va) * cy;
      const end = row * width + last;
      for (let at = row * width + left; at <= end; at += 1, shareB += bx, shareC += cx) {
        if (shareB < 0 || shareC < 0 || shareB + shareC > 1) continue;
        const here = inverse + shareB * ofB + shareC * ofC;
        if (here > near[at]) {
          near[at] = here;
          pixels[at] = drawn;
        }
      }
    }
  }

  /**
   * @param {drawing.View} view
   * @param {drawing.Vector} from
   * @param {drawing.Vector} to
   * @param {drawing.Colour} colour
   * @param {number} thick px
   * @param {number} front 1 + how much nearer it is drawn than it is
   */
  line(view, from, to, colour, thick, front) {
    const [one, other] = [seen(view, from), seen(view, to)];
    if (one[2] < NEAREST && other[2] < NEAREST) return;
    clip(one, other);
    clip(other, one);
    const [u, v, inverse] = this.onScreen(view, one);
    const end = this.onScreen(view, other);
    const longest = Math.max(Math.abs(end[0] - u), Math.abs(end[1] - v), 1);
    const steps = Math.min(MOST_STEPS, Math.ceil(longest));
    const drawn = packed(...colour);
    for (let step = 0; step <= steps; step += 1) {
      const share = step / steps;
      const here = (inverse + share * (end[2] - inverse)) * front;
      const x = Math.round(u + share * (end[0] - u) - thick / 2);
      const y = Math.round(v + share * (end[1] - v) - thick / 2);
      this.square(x, y, thick, here, drawn);
    }
  }

  /**
   * Pixels, and 1 / depth, of a point at the camera.
   * @param {drawing.View} view
   * @param {drawing.Vector} point
   * @returns {drawing.Vector}
   */
  onScreen(view, [x, y, z]) {
    return [this.width / 2 + view.focal * x / z, this.height / 2 + view.focal * y / z, 1 / z];
  }
}

/**
 * A pixel as ImageData has it.
 * @param {number} red
 * @param {number} green
 * @param {number} blue
 */
function packed(red, green, blue) { return 0xff000000 | blue << 16 | green << 8 | red; }

/**
 * The camera from what is at a pose of the scene.
 * @param {drawing.View} view
 * @param {drawing.Pose} pose
 */
function composed({ right, down, ahead, centre, distance }, pose) {
  const found = new Float32Array(12);
  [right, down, ahead].forEach((axis, row) => {
    for (let column = 0; column < 4; column += 1) {
      let sum = row === 2 && column === 3 ? distance : 0;
      for (let k = 0; k < 3; k += 1) {
        sum += axis[k] * (pose[4 * k + column] - (column === 3 ? centre[k] : 0));
      }
      found[4 * row + column] = sum;
    }
  });
  return found;
}

/**
 * A point at the camera.
 * @param {drawing.View} view
 * @param {drawing.Vector} point
 * @returns {drawing.Vector}
 */
function seen({ right, down, ahead, centre, distance }, point) {
  const [x, y, z] = [point[0] - centre[0], point[1] - centre[1], point[2] - centre[2]];
  /** @param {drawing.Vector} axis */
  const along = (axis) => axis[0] * x + axis[1] * y + axis[2] * z;
  return [along(right), along(down), along(ahead) + distance];
}

/**
 * Move a point that is behind the camera to before it.
 * @param {drawing.Vector} point
 * @param {drawing.Vector} towards
 */
function clip(point, towards) {
  if (point[2] >= NEAREST) return;
  const share = (NEAREST - point[2]) / (towards[2] - point[2]);
  for (let axis = 0; axis < 3; axis += 1) point[axis] += share * (towards[axis] - point[axis]);
}

/**
 * A flat triangle's colour in the light, packed.
 * @param {Float32Array} s
 * @param {number} a places of its corners in `s`
 * @param {number} b
 * @param {number} c
 * @param {drawing.Colour} colour
 */
function lit(s, a, b, c, colour) {
  const [x1, y1, z1] = [s[b] - s[a], s[b + 1] - s[a + 1], s[b + 2] - s[a + 2]];
  const [x2, y2, z2] = [s[c] - s[a], s[c + 1] - s[a + 1], s[c + 2] - s[a + 2]];
  const [x, y, z] = [y1 * z2 - z1 * y2, z1 * x2 - x1 * z2, x1 * y2 - y1 * x2];
  const length = Math.sqrt(x * x + y * y + z * z) || 1;
  const away = x * s[a] + y * s[a + 1] + z * s[a + 2] > 0 ? -1 : 1; // the side that is seen counts
  const facing = away * (x * LIGHT[0] + y * LIGHT[1] + z * LIGHT[2]) / length;
  const level = 0.42 + 0.58 * Math.max(0, facing);
  return packed(Math.round(colour[0] * level), Math.round(colour[1] * level),
    Math.round(colour[2] * level));
}
