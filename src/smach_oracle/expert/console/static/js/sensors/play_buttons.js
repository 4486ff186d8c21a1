// @ts-check
// The buttons of what can be played.
import { h, setText } from '../page/dom.js';

/**
 * @param {string} sign
 * @param {string} title
 * @param {string} id
 * @param {() => void} onclick
 */
export function playButton(sign, title, id, onclick) {
  return h('button', { class: 'tool', type: 'button', title, 'aria-label': title, onclick,
    'data-replay': id }, sign);
}

/**
 * @param {HTMLButtonElement} button
 * @param {boolean} playing
 */
export function showPlaying(button, playing) {
  const title = playing ? 'Pause' : 'Play';
  setText(button, playing ? '❚❚' : '▶');
  button.title = title;
  button.setAttribute('aria-label', title);
}
