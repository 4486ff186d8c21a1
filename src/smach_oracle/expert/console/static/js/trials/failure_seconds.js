// @ts-check
// What a bag has of the seconds before a failure of a trial that is replayed.
import { h, replace } from '../page/dom.js';
import { LastSeconds } from '../sensors/last_seconds.js';

export class FailureSeconds {
  /** @param {page.App} app */
  constructor(app) {
    this.app = app;
    this.root = h('div', {});
    this.number = 0; // of the replay
    /** @type {LastSeconds | null} */
    this.shown = null;
  }

  /** @param {number | undefined} number undefined where there is none */
  show(number = 0) {
    if (number === this.number) return;
    this.number = number;
    this.shown?.end();
    this.shown = number ? new LastSeconds(this.app) : null;
    this.shown?.show(number);
    replace(this.root, this.shown?.root);
  }
}
