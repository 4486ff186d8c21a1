// @ts-check
// A small picture of a whole drawing, in its corner, with a frame around what is seen. It is for
// the pointer: the keyboard has search and arrow keys.
import { svg } from '../page/dom.js';
import { keep, redrawWith, render } from '../page/redraw.js';
import { activeIn } from './focus_state.js';

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
    this.root = svg('svg', { class: 'graph-map', hidden: true });
  }

  /**
   * @param {server.Graph} graph
   * @param {machine.MachineState} machine
   */
  set({ path, states }, machine) {
    const active = activeIn(path, machine);
    const failed = machine.failed[path]?.state;
    redrawWith(this.states, [states, active, failed], () => (
      states.map(({ label, at }) => at && svg('rect', {
        class: label === failed ? 'failed' : active.includes(label) ? 'active' : '',
        x: at[0] - at[2] / 2, y: at[1] - at[3] / 2, width: at[2], height: at[3] }))));
  }

  /**
   * @param {Seen} seen
   * @param {Size} size
   */
  show({ x, y, width, height }, size) {
    const whole = this.states.childElementCount < FROM
      || (width >= size.width && height >= size.height);
    const scale = Math.min(WIDEST / size.width, HIGHEST / size.height);
    render(this.root, svg('svg', { class: 'graph-map', 'aria-hidden': 'true', hidden: whole,
      viewBox: [0, 0, size.width, size.height].join(' '), width: size.width * scale,
      height: size.height * scale, onpointerdown: (event) => this.press(event, scale) },
    keep(this.states), svg('rect', { class: 'map-frame', x, y, width, height })));
  }

  /**
   * @param {PointerEvent} event
   * @param {number} scale
   */
  press(event, scale) {
    event.stopPropagation();
    const box = this.root.getBoundingClientRect();
    this.onPlace([(event.clientX - box.left) / scale, (event.clientY - box.top) / scale]);
  }
}
