// Numbers as people read them.
import { h } from './dom.js';

export const CLASSES = { 0: '', 1: 'low', 2: 'moderate', 3: 'high' };

export function duration(seconds) {
  const whole = Math.max(0, Math.floor(seconds));
  if (whole < 60) return whole + ' s';
  if (whole < 3600) return Math.floor(whole / 60) + ':' + String(whole % 60).padStart(2, '0') + ' min';
  return Math.floor(whole / 3600) + ':' + String(Math.floor((whole % 3600) / 60)).padStart(2, '0') + ' h';
}

export function percent(share) {
  return share === null || share === undefined ? '–' : Math.round(100 * share) + '%';
}

export function hue(rate) {
  return Math.round(130 * (1 - Math.min(Math.max(rate, 0), 1)));
}

export function clock(epoch) {
  return new Date(epoch * 1000).toLocaleTimeString();
}

export function times(number) {
  return number === 1 ? 'once' : number === 2 ? 'twice' : number + ' times';
}

// A long name, that may be broken after each such sign.
export function breakable(name, sign) {
  return name.split(sign).flatMap((part, index) => (index ? [sign, h('wbr', {}), part] : [part]));
}

// Of a traceback that is the line that says what happened.
function lastLine(text) {
  return text.trim().split('\n').pop().slice(-300);
}

// What the text of an event adds to its words.
export function added(event) {
  const text = lastLine(event.text || '');
  return text && !(event.words || '').includes(text) ? ' ' + text : '';
}

// A bar for a failure rate, green to red; `share` is what is filled, where it is not the rate itself.
export function rateBar(rate, share, text) {
  if (rate === null || rate === undefined) return h('span', { class: 'rate unknown' }, '–');
  const filled = share === undefined ? rate : share;
  return h('span', { class: 'rate', '--hue': hue(rate), '--fill': Math.round(100 * filled) + '%' },
    h('span', { class: 'rate-bar' }), h('span', { class: 'rate-text' }, text || percent(filled)));
}

export function chip(text, kind, title) {
  return h('span', { class: 'chip ' + (kind || ''), title }, text);
}
