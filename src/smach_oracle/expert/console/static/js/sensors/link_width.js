// @ts-check
// How wide the images are that a link carries: narrower where their bytes take long, so that images
// stay fresh, and wider again where they are quick.

const WIDTHS = [160, 320, 640, 1280]; // px: those that the server knows
const SLOW_MS = 250; // that the bytes of an image may take
const QUICK_MS = 60;
const SLOW_IN_A_ROW = 2; // images, after which they become narrower
const QUICK_IN_A_ROW = 12;

export class LinkWidth {
  /** @param {number} wanted px, at most */
  constructor(wanted) {
    this.widths = WIDTHS.filter((width) => width <= wanted);
    this.at = this.widths.length - 1;
    this.slow = this.quick = 0; // images in a row
  }

  /** Pixels across that are asked for. */
  get now() { return this.widths[this.at]; }

  /** Whether the images are narrower than they were wanted. */
  get isNarrow() { return this.at < this.widths.length - 1; }

  /** @param {number} ms that the bytes of an image took */
  took(ms) {
    this.slow = ms > SLOW_MS ? this.slow + 1 : 0;
    this.quick = ms < QUICK_MS ? this.quick + 1 : 0;
    if (this.slow >= SLOW_IN_A_ROW && this.at > 0) this.step(-1);
    else if (this.quick >= QUICK_IN_A_ROW && this.isNarrow) this.step(1);
  }

  /** @param {1 | -1} by */
  step(by) {
    this.at += by;
    this.slow = this.quick = 0;
  }
}
