// @ts-check
// A button that is held by Enter or Space while it has the focus. It is let go with either key, and
// whenever the focus leaves it: the key's end would be told to another element then.
import { modified } from '../page/dom.js';

const KEYS = new Set(['Enter', ' ']);

/**
 * @param {HTMLElement} button
 * @param {{ press: () => void, release: () => void }} use
 * @param {AddEventListenerOptions} options of the listeners
 */
export function holdByKey(button, { press, release }, options) {
  button.addEventListener('keydown', (event) => {
    if (!KEYS.has(event.key)) return;
    event.preventDefault();
    if (modified(event)) release();
    else if (!event.repeat) press();
  }, options);
  button.addEventListener('keyup', (event) => {
    if (!KEYS.has(event.key)) return;
    event.preventDefault();
    release();
  }, options);
  button.addEventListener('blur', release, options);
}
