// @ts-check
// What is drawn on an image: a region, and strokes that say what belongs to the object. Pure.

/** @typedef {'rectangle' | 'free'} RegionTool */
/** @typedef {'object' | 'background'} Brush */
/** @typedef {RegionTool | Brush} Tool */
/** @typedef {{ tool: Tool, width: number, points: server.Point[] }} Line width in px */

const LEAST_SIDE = 6; // px: less is a slip of the hand
const SPACING = 2; // px between the corners of a free line
const MOST_POINTS = 600;

/**
 * Whether a tool corrects what was cut out of a region.
 * @param {Tool} tool
 * @returns {tool is Brush}
 */
export function isBrush(tool) { return tool === 'object' || tool === 'background'; }

export class Marking {
  constructor() {
    /** @type {server.Point[] | null} */
    this.region = null;
    /** @type {server.Stroke[]} */
    this.strokes = [];
    /** @type {Line | null} */
    this.line = null; // that is being drawn
  }

  clear() {
    this.region = null;
    this.strokes = [];
    this.line = null;
  }

  /**
   * @param {Tool} tool
   * @param {server.Point} point
   * @param {number} width px
   */
  begin(tool, point, width) {
    this.line = { tool, width, points: [point] };
  }

  /** @param {server.Point} point */
  move(point) {
    if (!this.line) return;
    const { tool, points } = this.line;
    const last = points[points.length - 1];
    const far = Math.hypot(point[0] - last[0], point[1] - last[1]) >= SPACING;
    if (tool === 'rectangle') this.line.points = [points[0], point];
    else if (points.length < MOST_POINTS && far) points.push(point);
  }

  /** End the line. Whether there is something new to cut out. */
  end() {
    const { line } = this;
    this.line = null;
    if (!line) return false;
    if (isBrush(line.tool)) {
      this.strokes.push(strokeOf(line));
      return Boolean(this.region);
    }
    const corners = cornersOf(line);
    if (isSlip(corners)) return false;
    this.region = corners;
    this.strokes = [];
    return true;
  }

  /** Take back the last stroke, else the region. Whether something is left to cut out. */
  undo() {
    if (!this.strokes.pop()) this.region = null;
    return Boolean(this.region);
  }

  /** The line of a region that is being drawn. */
  get regionLine() { return this.line && !isBrush(this.line.tool) ? this.line : null; }

  /** The region as it is shown, with the line that is being drawn. */
  get shownRegion() { return this.regionLine ? cornersOf(this.regionLine) : this.region; }

  /** The strokes as they are shown, with the line that is being drawn. */
  get shownStrokes() {
    const { line } = this;
    return line && isBrush(line.tool) ? [...this.strokes, strokeOf(line)] : this.strokes;
  }
}

/**
 * @param {Line} line
 * @returns {server.Stroke}
 */
function strokeOf({ tool, width, points }) {
  return { foreground: tool === 'object', width, points };
}

/**
 * @param {Line} line
 * @returns {server.Point[]}
 */
function cornersOf({ tool, points }) {
  if (tool !== 'rectangle') return points;
  const [first, last = first] = points;
  return [first, [last[0], first[1]], last, [first[0], last[1]]];
}

/** @param {server.Point[]} corners */
function isSlip(corners) {
  const [width, height] = [0, 1].map((axis) => {
    const places = corners.map((corner) => corner[axis]);
    return Math.max(...places) - Math.min(...places);
  });
  return corners.length < 3 || width < LEAST_SIDE || height < LEAST_SIDE;
}
