// @ts-check
// Keys that act on whatever is there, such as the next question. What a key would do must have been
// the same for a while: before that it is refused.
import { PERIOD_MS, SETTLING_MS, sayTooSoon } from './deliberate.js';

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

  /** Whether it is pressed on purpose; where it is not, the page says so. */
  get pressed() {
    this.look();
    if (!this.meaning) return false;
    const meant = performance.now() - this.sinceMs >= SETTLING_MS;
    if (!meant) sayTooSoon();
    return meant;
  }
}
