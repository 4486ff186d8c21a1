// @ts-check
// The newest message of a sensor, again and again: the next one is asked for when the last one is
// on the screen. Images get narrower where the link is slow.
import { LinkWidth } from './link_width.js';

const LEAST_PAUSE_MS = 60;
const TROUBLE_PAUSE_MS = 1000;
const AWAY_PAUSE_MS = 250;
const RATE_OVER_MS = 3000;
const TOO_MANY = 'Too many sensors at a time.';
/** @type {{ [status: number]: string | undefined }} */
const REFUSALS = { 404: 'It is gone.', 429: TOO_MANY, 503: TOO_MANY };

/**
 * The number of a sensor now; a console that was restarted gives other numbers. undefined where it
 * is gone.
 * @param {page.App} app
 * @param {string} topic
 * @param {string} [type]
 */
export function numberOf(app, topic, type) {
  const known = app.store.sensors;
  return known.find((each) => each.topic === topic && (!type || each.type === type))?.id;
}

/**
 * The message that does not come: the first one, or one after it; '' where that is not the trouble.
 * @typedef {'' | 'first' | 'next'} Missing
 */

/**
 * @template {server.SensorFacts} Facts what is told beside the messages of this kind of sensor
 * @typedef {object} Use
 * @property {(answer: Response, facts: Facts) => Promise<void> | void} take shows a message
 * @property {(text: string, missing: Missing) => void} say '' where all is well
 * @property {number} [width] px of images, at most
 * @property {number} [every] ms between two of them, at least
 * @property {() => number | undefined} [beside] the number of a robot where the facts tell
 *   the sensor's place, undefined for none
 */

/** @template {server.SensorFacts} Facts */
export class SensorFeed {
  /**
   * @param {page.App} app
   * @param {() => number | null | undefined} which the sensor's number; null: there is none yet,
   *   undefined: it is gone
   * @param {Element} root nothing is asked for while it is not on the page
   * @param {Use<Facts>} use
   */
  constructor(app, which, root, use) {
    this.app = app;
    this.which = which;
    this.root = root;
    this.use = use;
    this.link = new LinkWidth(use.width || 640);
    this.every = use.every || LEAST_PAUSE_MS;
    this.lost = false; // its place is not known
    /** @type {number[]} */
    this.times = [];
    this.running = true;
    /** @type {AbortController | null} */
    this.controller = null;
    this.loop();
  }

  stop() {
    this.running = false;
    if (this.controller) this.controller.abort();
  }

  /** Messages a second. */
  get rate() {
    const now = performance.now();
    this.times = this.times.filter((time) => now - time < RATE_OVER_MS);
    return this.times.length / (RATE_OVER_MS / 1000);
  }

  get beside() { return this.use.beside ? this.use.beside() : undefined; }

  async loop() {
    let after = 0;
    let last = '';
    while (this.running) {
      const [id, beside] = [this.which(), this.beside];
      const asked = id + ' ' + beside;
      if (asked !== last) after = 0;
      last = asked;
      if (document.hidden || !this.reachable || id === undefined || id === null) {
        if (id === undefined && this.reachable) this.use.say('It is gone.', '');
        await pause(AWAY_PAUSE_MS);
        continue;
      }
      const begun = performance.now();
      let rest = 0;
      try {
        after = await this.once(id, after, beside);
      } catch (err) {
        if (!this.running) return;
        rest = TROUBLE_PAUSE_MS;
        after = 0;
      }
      await pause(Math.max(rest, this.every - (performance.now() - begun)));
      await new Promise((resolve) => requestAnimationFrame(resolve));
    }
  }

  get reachable() { return this.root.isConnected && this.app.connection.connected; }

  /**
   * Take one message that is another than the one of a number; throws where that is refused.
   * @param {number} id
   * @param {number} after
   * @param {number | undefined} beside
   * @returns {Promise<number>} the number of the message now
   */
  async once(id, after, beside) {
    this.controller = new AbortController();
    const { signal } = this.controller;
    const query = 'after=' + after + '&width=' + this.link.now + (beside ? '&robot=' + beside : '');
    const answer = await this.app.connection.fetch('sample/' + id + '?' + query, { signal });
    if (answer.status === 204) {
      if (after) this.use.say('Nothing new comes.', 'next');
      else this.use.say('Nothing comes.', 'first');
      return this.lost ? 0 : after; // the last one again: its place may be known by now
    }
    if (answer.status === 422) {
      this.use.say(await answer.text(), '');
      return Number(answer.headers.get('X-Sequence')) || 0;
    }
    if (!answer.ok) {
      this.use.say(REFUSALS[answer.status] || 'Refused (' + answer.status + ').', '');
      throw new Error(String(answer.status));
    }
    return this.show(answer);
  }

  /** @param {Response} answer */
  async show(answer) {
    const header = answer.headers.get('X-Facts');
    /** @type {Facts} */
    const facts = header ? JSON.parse(header) : await answer.json();
    this.lost = 'astray' in facts;
    const begun = performance.now(); // the first of its bytes have come
    await this.use.take(answer, facts);
    if (this.use.width) this.link.took(performance.now() - begun);
    this.times.push(performance.now());
    this.use.say('', '');
    return facts.sequence;
  }
}

/** @param {number} ms */
function pause(ms) {
  return new Promise((resolve) => setTimeout(resolve, ms));
}
