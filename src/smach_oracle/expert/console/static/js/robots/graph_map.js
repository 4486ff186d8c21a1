// @ts-check
// A small picture of a whole drawing, in its corner, with a frame around what is seen. It is for
// the pointer: the keyboard has search and arrow keys.
import { svg } from '../page/dom.js';

/** @typedef {import('./graph_viewport.js').Place} Place */
/** @typedef {import('./graph_viewport.js').Seen} Seen */
/** @typedef {import('./graph_viewport.js').Size} Size */

const WIDEST = 150; // px
const HIGHEST = 200;
const FROM = 12; // states: a map of fewer would tell nothing

export class GraphMap {
  /** @param {(at: Place) => void} onPlace a place of the drawing was pressed */
  constructor(onPlace) {
    this.onPlace = onPlace;
    this.states = svg('g', {});
    this.frame = svg('rect', { class: 'map-frame' });
    this.root = svg('svg', { class: 'graph-map', 'aria-hidden': 'true',
      onpointerdown: (event) => this.press(event) }, this.states, this.frame);
    /** @type {Map<string, SVGRectElement>} */
    this.boxes = new Map(); // by label
    this.scale = 1;
    this.root.style.display = 'none';
  }

  /** @param {server.Graph} graph */
  set({ states }) {
    this.boxes = new Map(states.flatMap(({ label, at }) => (at ? [[label,
      svg('rect', { x: at[0] - at[2] / 2, y: at[1] - at[3] / 2, width: at[2], height: at[3] })]]
      : [])));
    this.states.replaceChildren(...this.boxes.values());
  }

  /**
   * @param {string} failed
   * @param {string[]} active
   */
  mark(failed, active) {
    for (const [label, box] of this.boxes) {
      box.classList.toggle('failed', label === failed);
      box.classList.toggle('active', active.includes(label));
    }
  }

  /**
   * @param {Seen} seen
   * @param {Size | null} size
   */
  show({ x, y, width, height }, size) {
    const whole = !size || this.boxes.size < FROM || (width >= size.width && height >= size.height);
    this.root.style.display = whole ? 'none' : '';
    if (whole || !size) return;
    this.scale = Math.min(WIDEST / size.width, HIGHEST / size.height);
    this.root.setAttribute('viewBox', [0, 0, size.width, size.height].join(' '));
    this.root.setAttribute('width', String(size.width * this.scale));
    this.root.setAttribute('height', String(size.height * this.scale));
    const frame = { x, y, width, height };
    for (const [name, value] of Object.entries(frame)) {
      this.frame.setAttribute(name, String(value));
    }
  }

  /** @param {PointerEvent} event */
  press(event) {
    event.stopPropagation();
    const box = this.root.getBoundingClientRect();
    this.onPlace([(event.clientX - box.left) / this.scale, (event.clientY - box.top) / this.scale]);
  }
}
