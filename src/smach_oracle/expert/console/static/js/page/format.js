// @ts-check
// Numbers and names as people read them.
import { h, setText } from './dom.js';

/** @type {{ [rank in server.FailureClass]: string }} */
export const FAILURE_CLASSES = { 0: '', 1: 'low', 2: 'moderate', 3: 'high' };

/** @param {number} seconds */
export function duration(seconds) {
  const whole = Math.max(0, Math.floor(seconds));
  if (whole < 60) return whole + ' s';
  if (whole < 3600) return Math.floor(whole / 60) + ':' + twoDigits(whole % 60) + ' min';
  return Math.floor(whole / 3600) + ':' + twoDigits(Math.floor((whole % 3600) / 60)) + ' h';
}

/**
 * How long ago something was. The frame lets it grow, without another drawing.
 * @param {number} at s since the epoch
 * @param {number} now by the server's clock
 */
export function since(at, now) { return h('span', { 'data-since': at }, duration(now - at)); }

/**
 * How long it is until something. The frame lets it shrink.
 * @param {number} at s since the epoch
 * @param {number} now by the server's clock
 */
export function until(at, now) { return h('span', { 'data-until': at }, duration(at - now)); }

/**
 * Time has passed for all that says how long.
 * @param {HTMLElement} root
 * @param {number} now by the server's clock
 */
export function letTimePass(root, now) {
  for (const shown of root.querySelectorAll('[data-since], [data-until]')) {
    const begun = shown.getAttribute('data-since');
    setText(shown, duration(begun === null ? Number(shown.getAttribute('data-until')) - now
      : now - Number(begun)));
  }
}

/** @param {number} number */
function twoDigits(number) { return String(number).padStart(2, '0'); }

/** @param {number | null | undefined} share */
export function percent(share) {
  return share === null || share === undefined ? '–' : Math.round(100 * share) + '%';
}

/**
 * Of a failure rate: green to red, in degrees.
 * @param {number} rate
 */
export function hue(rate) {
  return Math.round(130 * (1 - Math.min(Math.max(rate, 0), 1)));
}

/** @param {number} epoch s */
export function clock(epoch) {
  return new Date(epoch * 1000).toLocaleTimeString();
}

/** @param {number} number */
export function times(number) {
  if (number === 1) return 'once';
  return number === 2 ? 'twice' : number + ' times';
}

/**
 * '1 bag', '2 bags'.
 * @param {number} number
 * @param {string} one
 * @param {string} [many]
 */
export function counted(number, one, many = one + 's') {
  return number + ' ' + (number === 1 ? one : many);
}

/**
 * A long name, that may be broken after each such sign.
 * @param {string} name
 * @param {string} sign
 */
export function breakable(name, sign) {
  return name.split(sign).flatMap((part, index) => (index ? [sign, h('wbr', {}), part] : [part]));
}

/**
 * What the text of an event adds to its words.
 * @param {Pick<server.TrialEvent, 'text' | 'words'>} event
 */
export function added(event) {
  return event.text && !event.words.includes(event.text) ? ' ' + event.text : '';
}

/**
 * A bar for a failure rate, green to red.
 * @param {number | null | undefined} rate
 * @param {number} [share] what is filled, where it is not the rate itself
 * @param {string} [text]
 */
export function rateBar(rate, share, text) {
  if (rate === null || rate === undefined) return h('span', { class: 'rate unknown' }, '–');
  const filled = share === undefined ? rate : share;
  const looks = { '--hue': hue(rate), '--fill': Math.round(100 * filled) + '%' };
  return h('span', { class: 'rate', ...looks },
    h('span', { class: 'rate-bar' }), h('span', { class: 'rate-text' }, text || percent(filled)));
}

/**
 * @param {page.Child} text
 * @param {string} [kind]
 * @param {string} [title]
 */
export function chip(text, kind = '', title) {
  return h('span', { class: 'chip ' + kind, title }, text);
}
