// @ts-check
// Curves of some joints over the last minute, or another time.
import { h } from '../page/dom.js';

const HUES = [245, 20, 150, 320]; // of the curves
export const SPAN_S = 60;

/** @typedef {[time: number, value: number]} Sample s, and the joint's unit */

/**
 * Whose curve has which colour.
 * @param {string[]} names
 */
export function legendOf(names) {
  return h('p', { class: 'plot-legend' }, names.map((name, index) => (
    h('span', { class: 'series', '--hue': HUES[index] }, name))));
}

export class JointPlot {
  constructor() {
    this.canvas = h('canvas', { class: 'plot', role: 'img',
      'aria-label': 'Chosen joints over time' });
  }

  /**
   * @param {Sample[][]} curves
   * @param {number} now s
   * @param {number} [span] s that are shown
   */
  draw(curves, now, span = SPAN_S) {
    const { canvas } = this;
    const ratio = window.devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    const context = canvas.getContext('2d');
    if (!width || !height || !context) return;
    Object.assign(canvas, { width: width * ratio, height: height * ratio });
    context.scale(ratio, ratio);
    const values = curves.flat().map(([, value]) => value);
    const low = values.length ? Math.min(...values) : 0;
    const high = Math.max(low + 0.01, ...values);
    const [bottom, top] = [low - 0.08 * (high - low), high + 0.2 * (high - low)];
    /** @param {number} value */
    const y = (value) => height * (top - value) / (top - bottom);
    const levels = [low, (low + high) / 2, high];
    const style = getComputedStyle(canvas);
    context.strokeStyle = style.borderBottomColor;
    for (const level of levels) {
      context.beginPath();
      context.moveTo(0, y(level));
      context.lineTo(width, y(level));
      context.stroke();
    }
    curves.forEach((curve, index) => {
      context.strokeStyle = 'hsl(' + HUES[index] + ' 70% 58%)';
      context.lineWidth = 1.8;
      context.beginPath();
      for (const [time, value] of curve) {
        context.lineTo(width * (1 - (now - time) / span), y(value));
      }
      context.stroke();
    });
    if (values.length) this.writeLevels(context, levels, y);
  }

  /**
   * Over the curves, on a ground of their own.
   * @param {CanvasRenderingContext2D} context
   * @param {number[]} levels
   * @param {(value: number) => number} y
   */
  writeLevels(context, levels, y) {
    const style = getComputedStyle(this.canvas);
    context.font = '11px ' + style.fontFamily;
    for (const level of levels) {
      const text = level.toFixed(3);
      context.fillStyle = style.backgroundColor;
      context.fillRect(2, y(level) - 14, context.measureText(text).width + 4, 13);
      context.fillStyle = style.color;
      context.fillText(text, 4, y(level) - 3);
    }
  }
}
