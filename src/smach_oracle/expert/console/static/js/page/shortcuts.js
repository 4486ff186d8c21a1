// @ts-check
// Keys of a single letter or digit: they can be turned off, for those who speak to their machine or
// lean on the keyboard.
import { h } from './dom.js';
import { remember, remembered } from './preferences.js';

let on = remembered('keys', 'on') === 'on';

export function keysOn() { return on; }

/**
 * Whether a key does nothing now, since such keys are turned off.
 * @param {KeyboardEvent} event
 */
export function turnedOff(event) { return !on && event.key.length === 1; }

/** The button of the top bar. */
export function keysButton() {
  /** @type {HTMLButtonElement} */
  const button = h('button', { class: 'icon-button wide-only', id: 'keys',
    title: 'Single letters and digits as keys for what the page does',
    onclick: () => {
      on = !on;
      remember('keys', on ? 'on' : 'off');
      show(button);
    } });
  show(button);
  return button;
}

/** @param {HTMLButtonElement} button */
function show(button) {
  button.textContent = on ? 'Keys on' : 'Keys off';
  button.setAttribute('aria-pressed', String(on));
  document.body.dataset['keys'] = on ? 'on' : 'off';
}
