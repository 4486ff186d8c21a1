// What is drawn on a frame: a region, and strokes that say what belongs to the object. Pure but for the canvas.

const LEAST_SIDE = 6; // px: less is a slip of the hand
const SPACING = 2; // px between the corners of a free line
const MOST_POINTS = 600;

export class Marking {
  constructor() { this.clear(); }

  clear() {
    this.region = null;
    this.strokes = [];
    this.line = null;
  }

  get drawn() { return Boolean(this.region); }

  begin(tool, point, width) {
    this.line = { tool, width, points: [point] };
  }

  move(point) {
    const { tool, points } = this.line;
    const last = points[points.length - 1];
    if (tool === 'rectangle') this.line.points = [points[0], point];
    else if (points.length < MOST_POINTS && Math.hypot(point[0] - last[0], point[1] - last[1]) >= SPACING) points.push(point);
  }

  // Whether there is something new to cut out.
  end() {
    const line = this.line;
    this.line = null;
    if (!line) return false;
    if (line.tool === 'object' || line.tool === 'background') {
      this.strokes.push({ foreground: line.tool === 'object', width: line.width, points: line.points });
      return this.drawn;
    }
    const corners = line.tool === 'rectangle' ? rectangle(line.points) : line.points;
    const [width, height] = [0, 1].map((axis) => Math.max(...corners.map((point) => point[axis])) - Math.min(...corners.map((point) => point[axis])));
    if (corners.length < 3 || width < LEAST_SIDE || height < LEAST_SIDE) return false;
    this.region = corners;
    this.strokes = [];
    return true;
  }

  // The last stroke, else the region; whether something is left to cut out.
  undo() {
    if (!this.strokes.pop()) this.region = null;
    return this.drawn;
  }

  draw(context, scale, outlines, colours) {
    context.lineJoin = context.lineCap = 'round';
    if (outlines.length) mask(context, outlines, scale, colours);
    const line = this.line;
    const drawing = line && (line.tool === 'rectangle' || line.tool === 'free') ? line : null;
    const region = drawing ? (drawing.tool === 'rectangle' ? rectangle(drawing.points) : drawing.points) : this.region;
    if (region) outline(context, region, scale, colours, Boolean(drawing && drawing.tool === 'free'));
    const strokes = line && !drawing ? [...this.strokes, { foreground: line.tool === 'object', width: line.width, points: line.points }] : this.strokes;
    for (const stroke of strokes) brush(context, stroke, colours);
  }
}

function rectangle([first, last]) {
  const end = last || first;
  return [first, [end[0], first[1]], end, [first[0], end[1]]];
}

function trace(context, points, open) {
  context.beginPath();
  points.forEach(([x, y]) => context.lineTo(x + 0.5, y + 0.5));
  if (!open) context.closePath();
}

function outline(context, points, scale, colours, open) {
  trace(context, points, open);
  context.setLineDash([7 * scale, 5 * scale]);
  for (const [width, colour] of [[3.5, colours.under], [1.8, colours.region]]) {
    context.lineWidth = width * scale;
    context.strokeStyle = colour;
    context.stroke();
  }
  context.setLineDash([]);
}

function brush(context, stroke, colours) {
  trace(context, stroke.points, true);
  context.lineWidth = stroke.width;
  context.strokeStyle = stroke.foreground ? colours.object : colours.background;
  if (stroke.points.length === 1) context.lineTo(stroke.points[0][0] + 0.6, stroke.points[0][1] + 0.5);
  context.stroke();
}

function mask(context, outlines, scale, colours) {
  context.beginPath();
  for (const line of outlines) {
    for (let i = 0; i < line.length; i += 2) context[i ? 'lineTo' : 'moveTo'](line[i] + 0.5, line[i + 1] + 0.5);
    context.closePath();
  }
  context.fillStyle = colours.mask;
  context.fill('evenodd');
  context.lineWidth = 2 * scale;
  context.strokeStyle = colours.edge;
  context.stroke();
}
