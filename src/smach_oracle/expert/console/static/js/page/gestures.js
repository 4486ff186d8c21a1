// @ts-check
// Moving what is drawn on an element: one finger or a pressed button drags, two fingers or the
// wheel zoom; while it has the focus the arrow keys drag, + and - zoom.
import { modified } from './dom.js';

/**
 * @typedef {object} Moves
 * @property {(dx: number, dy: number, other: boolean) => void} drag by so many px; `other`: with
 *   another button than the left one, with two fingers, or with Shift
 * @property {(factor: number, at?: [x: number, y: number]) => void} zoom above 1: closer; px of the
 *   window: what stays there, else the middle
 * @property {() => void} [end] a finger was lifted
 * @property {number} step px for an arrow key
 * @property {number} closer for a key
 * @property {number} wheel for 1 px of the wheel, as a logarithm
 */

/** @type {{ [key: string]: [number, number] | undefined }} */
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

export class Gestures {
  /**
   * @param {GlobalEventHandlers} element
   * @param {Moves} moves
   */
  constructor(element, moves) {
    this.moves = moves;
    /** @type {Map<number, PointerEvent>} */
    this.fingers = new Map();
    element.addEventListener('pointerdown', (event) => {
      if (!this.pressed) this.listenWhilePressed();
      this.fingers.set(event.pointerId, event);
    });
    element.addEventListener('wheel', (event) => {
      event.preventDefault();
      moves.zoom(Math.exp(-event.deltaY * moves.wheel), [event.clientX, event.clientY]);
    }, { passive: false });
    element.addEventListener('keydown', (event) => this.key(event));
  }

  get pressed() { return this.fingers.size > 0; }

  /** To the window, and no longer: it would keep every drawing that there ever was. */
  listenWhilePressed() {
    const off = new AbortController();
    const { signal } = off;
    window.addEventListener('pointermove', (event) => this.move(event), { signal });
    /** @param {PointerEvent} event */
    const end = ({ pointerId }) => {
      this.fingers.delete(pointerId);
      if (!this.pressed) off.abort();
      this.moves.end?.();
    };
    window.addEventListener('pointerup', end, { signal });
    window.addEventListener('pointercancel', end, { signal });
  }

  /** @param {PointerEvent} event */
  move(event) {
    const before = this.fingers.get(event.pointerId);
    if (!before) return;
    const other = [...this.fingers.values()].find((each) => each.pointerId !== event.pointerId);
    this.fingers.set(event.pointerId, event);
    const [dx, dy] = [event.clientX - before.clientX, event.clientY - before.clientY];
    if (!other) this.moves.drag(dx, dy, Boolean(event.buttons & 6) || event.shiftKey);
    else {
      this.moves.zoom(span(event, other) / span(before, other),
        [(event.clientX + other.clientX) / 2, (event.clientY + other.clientY) / 2]);
      this.moves.drag(dx / 2, dy / 2, true);
    }
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    const { drag, zoom, step, closer } = this.moves;
    const arrow = ARROWS[event.key];
    if (modified(event) || (!arrow && event.key !== '+' && event.key !== '-')) return;
    event.preventDefault();
    event.stopPropagation();
    if (arrow) drag(arrow[0] * step, arrow[1] * step, event.shiftKey);
    else zoom(event.key === '+' ? closer : 1 / closer);
  }
}

/**
 * px between two fingers.
 * @param {PointerEvent} one
 * @param {PointerEvent} other
 */
function span(one, other) {
  return Math.hypot(one.clientX - other.clientX, one.clientY - other.clientY) || 1;
}
