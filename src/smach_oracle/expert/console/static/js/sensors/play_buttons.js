// @ts-check
// The buttons of what can be played.
import { h } from '../page/dom.js';

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
 * @param {boolean} playing
 * @param {() => void} onclick
 */
export function playOrPause(playing, onclick) {
  return playing ? playButton('❚❚', 'Pause', 'play', onclick)
    : playButton('▶', 'Play', 'play', onclick);
}
