// @ts-check
// Where the page itself puts the keyboard's focus. Enter and Space act on something else then, so
// that what has just got the focus in this way is not to be pressed yet.

/** @type {{ element: Element | null, atMs: number }} */
let newest = { element: null, atMs: -Infinity };

/**
 * Put the focus on an element, without scrolling.
 * @param {HTMLElement} element
 */
export function moveFocus(element) {
  element.focus({ preventScroll: true });
  if (document.activeElement === element) newest = { element, atMs: performance.now() };
}

/**
 * Whether the page has put the focus on an element less than some ms ago.
 * @param {Element} element
 * @param {number} ms
 */
export function justGiven(element, ms) {
  return element === newest.element && performance.now() - newest.atMs < ms;
}

/**
 * Whether nobody would miss the focus: it is nowhere, or in one of these.
 * @param {...Element} elements
 */
export function focusIsFree(...elements) {
  const { activeElement } = document;
  return !activeElement || activeElement === document.body
    || elements.some((element) => element.contains(activeElement));
}
