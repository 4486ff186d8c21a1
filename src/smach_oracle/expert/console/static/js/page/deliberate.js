// @ts-check
// What starts or ends something is sent only where it was meant. An element with `data-deliberate`
// is settled once it has lain still, enabled and uncovered, for a while; before that, a click on it
// is refused. The second tap of a double tap thus never reaches what the first one has brought. So
// is a key that presses what has the focus, where the page has just put the focus there.
//
// The attribute's value says what a click would do: where it changes, the element is another one.
// What is held begins with `hold`, and is refused as it is pressed. What only shows something
// begins with `open`. It is never refused: `wasMeant` says whether something may be sent with it at
// once. What stops or lets go never has the attribute.
import { toast } from './dom.js';
import { justGiven } from './focus.js';

/**
 * @typedef {object} Place
 * @property {string} meaning
 * @property {number[]} sides px, on the screen: left, top, right, bottom
 */
/** @typedef {{ place: Place, sinceMs: number }} Rest */

export const SETTLING_MS = 700;
export const PERIOD_MS = 100;
const OUT_OF_SIGHT = 10; // how much more seldom those are looked at that are out of sight
const SELECTOR = '[data-deliberate]';
const HELD = /^hold /;
const OPENS = /^open /;
const HOLDING = new Set(['Enter', ' ']); // the keys that press what has the focus
const STILL = 4; // px by which an element may move and yet lie under the same finger
const TOO_SOON = 'Not sent: the page had just changed there. Press again.';

/** @type {WeakMap<Element, Rest>} */
let rests = new WeakMap(); // of those that can be pressed
/** @type {WeakMap<Element, boolean>} */
const inSight = new WeakMap(); // of all that were ever seen here
let looks = 0;
/** @type {{ element: HTMLElement, meaning: string, settled: boolean } | null} */
let pressed = null;
/** @type {Event | null} the newest click that has opened something, and came too soon */
let hasty = null;

/** Begin: once a page. */
export function watchOverClicks() {
  window.addEventListener('pointerdown', (event) => press(event), true);
  window.addEventListener('click', (event) => judge(event), true);
  window.addEventListener('keydown', (event) => holdByKey(event), true);
  document.addEventListener('visibilitychange', () => {
    if (!document.hidden) rests = new WeakMap(); // what lay there before is not remembered
  });
  const sight = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries) {
      inSight.set(target, isIntersecting);
      if (!isIntersecting) forget(target); // it may come back to the same place
    }
  });
  setInterval(() => look(sight), PERIOD_MS);
}

/** @param {Element} element */
function forget(element) {
  rests.delete(element);
  element.removeAttribute('data-settled');
}

/**
 * Whether an element has lain there for long enough to be pressed on purpose.
 * @param {HTMLElement} element
 */
function settled(element) {
  const nowMs = performance.now();
  const rest = restOf(element, nowMs);
  if (!rest) return false;
  rests.set(element, rest);
  return nowMs - rest.sinceMs >= SETTLING_MS;
}

/**
 * Whether something has been the same, seen, for long enough to be meant.
 * @param {number} sinceMs
 */
export function longSince(sinceMs) { return performance.now() - sinceMs >= SETTLING_MS; }

/**
 * Whether what was clicked had lain there for long enough.
 * @param {Event} event a click on an element that opens something
 */
export function wasMeant(event) { return event !== hasty; }

/** Say that a press was refused, for that it came too soon. */
export function sayTooSoon() {
  const { dataset } = document.body;
  dataset['refused'] = String(Number(dataset['refused'] || 0) + 1);
  toast(TOO_SOON, 'warn');
}

/** @param {IntersectionObserver} sight */
function look(sight) {
  const nowMs = performance.now();
  looks += 1;
  for (const element of document.querySelectorAll(SELECTOR)) {
    if (!(element instanceof HTMLElement)) continue;
    if (!inSight.has(element)) {
      inSight.set(element, true); // as long as nothing else is known
      sight.observe(element);
    }
    if (!inSight.get(element) && looks % OUT_OF_SIGHT) continue;
    const before = rests.has(element);
    const rest = restOf(element, nowMs);
    if (!rest) forget(element);
    else {
      rests.set(element, rest);
      element.toggleAttribute('data-settled', before && nowMs - rest.sinceMs >= SETTLING_MS);
    }
  }
}

/**
 * @param {HTMLElement} element
 * @param {number} nowMs
 * @returns {Rest | null} null: it cannot be pressed
 */
function restOf(element, nowMs) {
  const place = placeOf(element);
  if (!place) return null;
  const before = rests.get(element);
  return before && same(before.place, place) ? before : { place, sinceMs: nowMs };
}

/**
 * @param {HTMLElement} element
 * @returns {Place | null}
 */
function placeOf(element) {
  const { left, top, right, bottom } = element.getBoundingClientRect();
  if (right <= left || bottom <= top || element.matches(':disabled')) return null;
  const over = document.elementFromPoint((left + right) / 2, (top + bottom) / 2);
  if (over && !element.contains(over)) return null; // null: out of the window
  return { meaning: meaningOf(element), sides: [left, top, right, bottom] };
}

/** @param {HTMLElement} element */
function meaningOf(element) { return element.dataset['deliberate'] || ''; }

/**
 * @param {Place} one
 * @param {Place} other
 */
function same(one, other) {
  return one.meaning === other.meaning
    && one.sides.every((side, index) => Math.abs(side - other.sides[index]) <= STILL);
}

/** @param {Event} event */
function elementOf({ target }) {
  const element = target instanceof Element ? target.closest(SELECTOR) : null;
  return element instanceof HTMLElement ? element : null;
}

/** @param {PointerEvent} event */
function press(event) {
  const element = elementOf(event);
  pressed = element && { element, meaning: meaningOf(element), settled: settled(element) };
  if (pressed && !pressed.settled && HELD.test(pressed.meaning)) refuse(event);
}

/** @param {KeyboardEvent} event */
function holdByKey(event) {
  const element = HOLDING.has(event.key) && !event.repeat ? elementOf(event) : null;
  if (element && HELD.test(meaningOf(element)) && !settledForKeys(element)) refuse(event);
}

/**
 * Whether a key that presses what has the focus, or one of the element's own, is meant.
 * @param {HTMLElement} element
 */
function settledForKeys(element) { return settled(element) && !justGiven(element, SETTLING_MS); }

/** @param {Event} event */
function refuse(event) {
  event.preventDefault();
  event.stopImmediatePropagation();
  sayTooSoon();
}

/** @param {MouseEvent} event */
function judge(event) {
  const element = elementOf(event);
  const before = pressed;
  pressed = null;
  if (!element || HELD.test(meaningOf(element))) return;
  // a key that presses a button, or a script, has no pointer that went down before
  const ofPointer = event.detail > 0 && before && before.element === element;
  const meant = ofPointer ? before.settled && before.meaning === meaningOf(element)
    : settledForKeys(element);
  if (meant) return;
  if (OPENS.test(meaningOf(element))) hasty = event;
  else refuse(event);
}
