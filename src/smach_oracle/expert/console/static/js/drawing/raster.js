// Draws points, triangles and lines in 3D into pixels, each with a depth of its own; needs nothing of the graphics card.
// A view is {right, down, ahead: axes of the screen, centre, distance, focal: px, width, height: px}.

const NEAREST = 0.02; // m
const LIGHT = [-0.32, -0.64, -0.7]; // from the left, above, and whoever looks

export class Raster {
  constructor() { this.scratch = new Float32Array(0); }

  // Begin an empty picture.
  begin(image) {
    const size = image.width * image.height;
    this.pixels = new Uint32Array(image.data.buffer);
    if (!this.near || this.near.length !== size) this.near = new Float32Array(size);
    else this.near.fill(0);
    [this.width, this.height] = [image.width, image.height];
  }

  // Points (x, y, z, ...), squares of `size` m, at least `least` px; colours (r, g, b, ...).
  points(view, points, colours, size, least) {
    const { right, down, ahead, centre, distance, focal } = view;
    const { width, height, near, pixels } = this;
    for (let i = 0; i < points.length; i += 3) {
      const [x, y, z] = [points[i] - centre[0], points[i + 1] - centre[1], points[i + 2] - centre[2]];
      const depth = x * ahead[0] + y * ahead[1] + z * ahead[2] + distance;
      if (depth < NEAREST) continue;
      const side = Math.min(6 * least, Math.max(least, Math.round(focal * size / depth)));
      const u = Math.round(width / 2 + focal * (x * right[0] + y * right[1] + z * right[2]) / depth - side / 2);
      const v = Math.round(height / 2 + focal * (x * down[0] + y * down[1] + z * down[2]) / depth - side / 2);
      const colour = 0xff000000 | colours[i + 2] << 16 | colours[i + 1] << 8 | colours[i];
      const inverse = 1 / depth;
      for (let row = Math.max(0, v); row < Math.min(height, v + side); row += 1) {
        for (let column = Math.max(0, u), at = row * width + column; column < Math.min(width, u + side); column += 1, at += 1) {
          if (inverse > near[at]) {
            near[at] = inverse;
            pixels[at] = colour;
          }
        }
      }
    }
  }

  // Triangles of a geometry {corners, triangles} at a place (3 x 4, by rows), in one colour [r, g, b].
  mesh(view, { corners, triangles }, place, colour) {
    const camera = composed(view, place);
    const count = corners.length / 3;
    if (this.scratch.length < 6 * count) this.scratch = new Float32Array(6 * count);
    const scratch = this.scratch; // x, y, z of the camera, u, v, 1 / z
    for (let i = 0, at = 0; i < corners.length; i += 3, at += 6) {
      const [x, y, z] = [corners[i], corners[i + 1], corners[i + 2]];
      const depth = camera[8] * x + camera[9] * y + camera[10] * z + camera[11];
      scratch[at] = camera[0] * x + camera[1] * y + camera[2] * z + camera[3];
      scratch[at + 1] = camera[4] * x + camera[5] * y + camera[6] * z + camera[7];
      scratch[at + 2] = depth;
      scratch[at + 3] = this.width / 2 + view.focal * scratch[at] / depth;
      scratch[at + 4] = this.height / 2 + view.focal * scratch[at + 1] / depth;
      scratch[at + 5] = 1 / depth;
    }
    for (let i = 0; i < triangles.length; i += 3) this.triangle(scratch, 6 * triangles[i], 6 * triangles[i + 1], 6 * triangles[i + 2], colour);
  }

  triangle(s, a, b, c, colour) {
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
    const [bx, by, cx, cy] = [(vc - va) / area, (ua - uc) / area, (va - vb) / area, (ub - ua) / area];
    const [inverse, ofB, ofC] = [s[a + 5], s[b + 5] - s[a + 5], s[c + 5] - s[a + 5]];
    for (let row = top; row <= bottom; row += 1) {
      let shareB = (left + 0.5 - ua) * bx + (row + 0.5 - va) * by;
      let shareC = (left + 0.5 - ua) * cx + (row + 0.5 - va) * cy;
      for (let at = row * width + left, end = row * width + last; at <= end; at += 1, shareB += bx, shareC += cx) {
        if (shareB < 0 || shareC < 0 || shareB + shareC > 1) continue;
        const here = inverse + shareB * ofB + shareC * ofC;
        if (here > near[at]) {
          near[at] = here;
          pixels[at] = drawn;
        }
      }
    }
  }

  // A line between two points, `thick` px; `front`: 1 + how much nearer it counts as.
  line(view, from, to, colour, thick, front = 1) {
    const [one, other] = [seen(view, from), seen(view, to)];
    if (one[2] < NEAREST && other[2] < NEAREST) return;
    clip(one, other);
    clip(other, one);
    const place = ([x, y, z]) => [this.width / 2 + view.focal * x / z, this.height / 2 + view.focal * y / z, 1 / z];
    const [[u, v, inverse], end] = [place(one), place(other)];
    const steps = Math.min(4000, Math.ceil(Math.max(Math.abs(end[0] - u), Math.abs(end[1] - v), 1)));
    const drawn = 0xff000000 | colour[2] << 16 | colour[1] << 8 | colour[0];
    for (let step = 0; step <= steps; step += 1) {
      const share = step / steps;
      const here = (inverse + share * (end[2] - inverse)) * front;
      const [x, y] = [Math.round(u + share * (end[0] - u) - thick / 2), Math.round(v + share * (end[1] - v) - thick / 2)];
      for (let row = Math.max(0, y); row < Math.min(this.height, y + thick); row += 1) {
        for (let column = Math.max(0, x); column < Math.min(this.width, x + thick); column += 1) {
          const at = row * this.width + column;
          if (here > this.near[at]) {
            this.near[at] = here;
            this.pixels[at] = drawn;
          }
        }
      }
    }
  }
}

// 3 x 4, by rows: the camera from what is at a place.
function composed({ right, down, ahead, centre, distance }, place) {
  const found = new Float32Array(12);
  [right, down, ahead].forEach((axis, row) => {
    for (let column = 0; column < 4; column += 1) {
      let sum = row === 2 && column === 3 ? distance : 0;
      for (let k = 0; k < 3; k += 1) sum += axis[k] * (place[4 * k + column] - (column === 3 ? centre[k] : 0));
      found[4 * row + column] = sum;
    }
  });
  return found;
}

function seen({ right, down, ahead, centre, distance }, point) {
  const [x, y, z] = point.map((each, axis) => each - centre[axis]);
  return [right, down, ahead].map((axis, row) => axis[0] * x + axis[1] * y + axis[2] * z + (row === 2 ? distance : 0));
}

// Move what is behind whoever looks to before it.
function clip(point, towards) {
  if (point[2] >= NEAREST) return;
  const share = (NEAREST - point[2]) / (towards[2] - point[2]);
  for (let axis = 0; axis < 3; axis += 1) point[axis] += share * (towards[axis] - point[axis]);
}

// A flat triangle's colour in the light.
function lit(s, a, b, c, colour) {
  const [x1, y1, z1] = [s[b] - s[a], s[b + 1] - s[a + 1], s[b + 2] - s[a + 2]];
  const [x2, y2, z2] = [s[c] - s[a], s[c + 1] - s[a + 1], s[c + 2] - s[a + 2]];
  const [x, y, z] = [y1 * z2 - z1 * y2, z1 * x2 - x1 * z2, x1 * y2 - y1 * x2];
  const length = Math.sqrt(x * x + y * y + z * z) || 1;
  const away = x * s[a] + y * s[a + 1] + z * s[a + 2] > 0 ? -1 : 1; // the side that is seen counts
  const level = 0.42 + 0.58 * Math.max(0, away * (x * LIGHT[0] + y * LIGHT[1] + z * LIGHT[2]) / length);
  return 0xff000000 | Math.round(colour[2] * level) << 16 | Math.round(colour[1] * level) << 8 | Math.round(colour[0] * level);
}
