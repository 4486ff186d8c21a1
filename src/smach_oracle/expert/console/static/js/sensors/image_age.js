// @ts-check
// How old the image of a live camera is, by its stamp and the robot's clock.
import { h, setText } from '../page/dom.js';
import { duration } from '../page/format.js';

const PERIOD_MS = 500;
const OLD_S = 3;
const AHEAD_S = 1; // that its clock may differ

export class ImageAge {
  constructor() {
    this.root = h('span', { class: 'image-age number' });
    /** @type {number | null | undefined} */
    this.age = undefined; // s, when it came; null: not known
    this.came = 0; // ms
    this.timer = setInterval(() => this.show(), PERIOD_MS);
  }

  stop() { clearInterval(this.timer); }

  /** @param {number | null | undefined} age s */
  take(age) {
    this.age = age;
    this.came = performance.now();
    this.show();
  }

  show() {
    const { age } = this;
    if (age === undefined) return;
    const now = age === null ? null : age + (performance.now() - this.came) / 1000;
    setText(this.root, wordsOf(now));
    this.root.classList.toggle('old', now === null || now > OLD_S || now < -AHEAD_S);
  }
}

/** @param {number | null} age s */
function wordsOf(age) {
  if (age === null) return 'age not known';
  if (age < -AHEAD_S) return 'stamped ' + duration(-age) + ' ahead of the robot’s clock';
  return (age < 10 ? Math.max(0, age).toFixed(1) + ' s' : duration(age)) + ' old';
}
