// @ts-check
// Draws on a canvas what is marked on an image, and what was cut out.

/** @typedef {import('./marking.js').Marking} Marking */

const ARM = 14; // px of the screen, of the cross
const COLOURS = { region: '#2f6bff', under: '#ffffffd0', mask: '#5b8cff66', edge: '#7fb0ff',
  object: '#3ddc84cc', background: '#ff5a52cc' };

/**
 * @param {CanvasRenderingContext2D} context
 * @param {Marking} marking
 * @param {number[][]} outlines x, y, x, y, ... of each line around what was cut out
 * @param {number} scale px of the image for one of the screen
 */
export function drawMarking(context, marking, outlines, scale) {
  context.lineJoin = context.lineCap = 'round';
  if (outlines.length) drawMask(context, outlines, scale);
  const region = marking.shownRegion;
  const open = marking.regionLine?.tool === 'free';
  if (region) drawOutline(context, region, scale, open);
  for (const stroke of marking.shownStrokes) drawStroke(context, stroke);
}

/**
 * @param {CanvasRenderingContext2D} context
 * @param {server.Point[]} points
 * @param {boolean} open
 */
function trace(context, points, open) {
  context.beginPath();
  points.forEach(([x, y]) => context.lineTo(x + 0.5, y + 0.5));
  if (!open) context.closePath();
}

/**
 * @param {CanvasRenderingContext2D} context
 * @param {server.Point[]} points
 * @param {number} scale
 * @param {boolean} open
 */
function drawOutline(context, points, scale, open) {
  trace(context, points, open);
  context.setLineDash([7 * scale, 5 * scale]);
  for (const { width, colour } of [{ width: 3.5, colour: COLOURS.under },
    { width: 1.8, colour: COLOURS.region }]) {
    context.lineWidth = width * scale;
    context.strokeStyle = colour;
    context.stroke();
  }
  context.setLineDash([]);
}

/**
 * @param {CanvasRenderingContext2D} context
 * @param {server.Stroke} stroke
 */
function drawStroke(context, { foreground, width, points }) {
  trace(context, points, true);
  context.lineWidth = width;
  context.strokeStyle = foreground ? COLOURS.object : COLOURS.background;
  if (points.length === 1) context.lineTo(points[0][0] + 0.6, points[0][1] + 0.5);
  context.stroke();
}

/**
 * Where the keyboard draws.
 * @param {CanvasRenderingContext2D} context
 * @param {server.Point} point
 * @param {number} scale px of the image for one of the screen
 */
export function drawCross(context, [x, y], scale) {
  const arm = ARM * scale;
  context.beginPath();
  context.moveTo(x + 0.5 - arm, y + 0.5);
  context.lineTo(x + 0.5 + arm, y + 0.5);
  context.moveTo(x + 0.5, y + 0.5 - arm);
  context.lineTo(x + 0.5, y + 0.5 + arm);
  for (const { width, colour } of [{ width: 4, colour: COLOURS.under },
    { width: 2, colour: COLOURS.region }]) {
    context.lineWidth = width * scale;
    context.strokeStyle = colour;
    context.stroke();
  }
}

/**
 * @param {CanvasRenderingContext2D} context
 * @param {number[][]} outlines
 * @param {number} scale
 */
function drawMask(context, outlines, scale) {
  context.beginPath();
  for (const line of outlines) {
    context.moveTo(line[0] + 0.5, line[1] + 0.5);
    for (let i = 2; i < line.length; i += 2) context.lineTo(line[i] + 0.5, line[i + 1] + 0.5);
    context.closePath();
  }
  context.fillStyle = COLOURS.mask;
  context.fill('evenodd');
  context.lineWidth = 2 * scale;
  context.strokeStyle = COLOURS.edge;
  context.stroke();
}
