// @ts-check
// The events of a trial as a list, newest first.
import { h, replace } from '../page/dom.js';
import { added } from '../page/format.js';
import { whenLetGo } from '../page/redraw.js';

const MOST_SHOWN = 600;

export class EventLog {
  /** @param {(seq: number) => void} onPick an event was chosen */
  constructor(onPick) {
    this.onPick = onPick;
    this.root = h('ol', { class: 'event-log', tabindex: 0,
      'aria-label': 'Events, newest first' });
    this.shown = 0; // events of the trial
    /** @type {HTMLElement | null} */
    this.marked = null;
  }

  clear() {
    this.shown = 0;
    replace(this.root);
  }

  /** @param {() => server.TrialEvent[]} eventsNow of the trial, so far */
  show(eventsNow) { whenLetGo(this.root, () => this.add(eventsNow())); }

  /** @param {server.TrialEvent[]} events */
  add(events) {
    const fresh = events.slice(this.shown);
    this.shown = events.length;
    for (const event of fresh) this.root.prepend(this.row(event, events[0].t));
    while (this.root.childElementCount > MOST_SHOWN) this.root.lastElementChild?.remove();
  }

  /**
   * @param {server.TrialEvent} event
   * @param {number} begin of the trial
   */
  row(event, begin) {
    const { seq, kind, t, words } = event;
    return h('li', { 'data-seq': seq, class: 'event ' + kind, onclick: () => this.onPick(seq) },
      h('span', { class: 'number dim' }, '+' + (t - begin).toFixed(2) + ' s'),
      h('span', {}, words || kind, h('span', { class: 'dim' }, added(event))));
  }

  /**
   * Mark the event under the cursor.
   * @param {number} seq
   */
  mark(seq) {
    if (this.marked) this.marked.classList.remove('picked');
    this.marked = this.root.querySelector('[data-seq="' + seq + '"]');
    if (!this.marked) return;
    this.marked.classList.add('picked');
    const { scrollTop, clientHeight } = this.root;
    const top = this.marked.offsetTop - this.root.offsetTop;
    if (top < scrollTop || top + this.marked.offsetHeight > scrollTop + clientHeight) {
      this.root.scrollTop = top - clientHeight / 2;
    }
  }
}
