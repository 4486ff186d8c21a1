// @ts-check
// Points, boxes and places of frames in 3D.

/**
 * A vector from what is said of each axis (0, 1, 2).
 * @param {(axis: number) => number} along
 * @returns {drawing.Vector}
 */
export function vector(along) { return [along(0), along(1), along(2)]; }

/**
 * A point of one frame in another.
 * @param {drawing.Pose} pose
 * @param {ArrayLike<number>} point
 */
export function placed(pose, point) {
  return vector((axis) => {
    const row = 4 * axis;
    return pose[row] * point[0] + pose[row + 1] * point[1] + pose[row + 2] * point[2]
      + pose[row + 3];
  });
}

/**
 * One pose after the other.
 * @param {drawing.Pose} one
 * @param {drawing.Pose} other
 */
export function chained(one, other) {
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

/**
 * The eight corners of a box.
 * @param {drawing.Box} box
 * @returns {drawing.Vector[]}
 */
export function cornersOf(box) {
  /** @type {drawing.Vector[]} */
  const found = [];
  for (const [x] of box) for (const [, y] of box) for (const [, , z] of box) found.push([x, y, z]);
  return found;
}

/**
 * The box around some points; of none it is empty (low is infinite).
 * @param {drawing.Vector[]} points
 * @returns {drawing.Box}
 */
export function boxAround(points) {
  return [vector((axis) => Math.min(...points.map((point) => point[axis]))),
    vector((axis) => Math.max(...points.map((point) => point[axis])))];
}

/** @param {drawing.Box} box */
export function middleOf([low, high]) { return vector((axis) => (low[axis] + high[axis]) / 2); }

/**
 * The length of a box's diagonal.
 * @param {drawing.Box} box
 */
export function diagonalOf([low, high]) {
  return Math.hypot(...vector((axis) => high[axis] - low[axis]));
}
