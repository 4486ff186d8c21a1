// @ts-check
// Keys that open whatever is there, such as the next question. They are never refused. Where what a
// key does has not been the same for a while, nothing is sent with it at once.
import { PERIOD_MS, longSince } from './deliberate.js';

export class SettledKey {
  /** @param {() => string} meaningOf what the key would do now, '' for nothing */
  constructor(meaningOf) {
    this.meaningOf = meaningOf;
    this.meaning = '';
    this.sinceMs = performance.now();
    document.addEventListener('visibilitychange', () => {
      if (!document.hidden) this.sinceMs = performance.now(); // nobody has seen it before
    });
    setInterval(() => this.look(), PERIOD_MS);
  }

  /** Notice whether it would do something else by now. */
  look() {
    const meaning = this.meaningOf();
    if (meaning === this.meaning) return;
    this.meaning = meaning;
    this.sinceMs = performance.now();
  }

  /** Whether it would have done the same for long enough to be meant. */
  get meant() {
    this.look();
    return longSince(this.sinceMs);
  }
}
