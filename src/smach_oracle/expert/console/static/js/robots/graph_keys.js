// @ts-check
// The keys of a drawing that has the focus: the arrow keys move what is seen, + and - zoom.
import { modified } from '../page/dom.js';

/** @typedef {import('./graph_viewport.js').GraphViewport} GraphViewport */

const STEP = 60; // px
const CLOSER = 1.3;
/** @type {{ [key: string]: [dx: number, dy: number] | undefined }} */
const STEPS = { ArrowLeft: [STEP, 0], ArrowRight: [-STEP, 0], ArrowUp: [0, STEP],
  ArrowDown: [0, -STEP] };

/**
 * @param {SVGSVGElement} drawing
 * @param {GraphViewport} viewport
 */
export function takeGraphKeys(drawing, viewport) {
  drawing.addEventListener('keydown', (event) => {
    const step = STEPS[event.key];
    if (modified(event) || (!step && event.key !== '+' && event.key !== '-')) return;
    event.preventDefault();
    event.stopPropagation();
    if (step) viewport.shift(...step);
    else viewport.zoom(event.key === '+' ? CLOSER : 1 / CLOSER);
  });
}
