// @ts-check
// What is told to those who hear the page instead of looking at it: a live region of index.html.
import { h, part } from './dom.js';

const MOST_KEPT = 3; // texts; the oldest go

/**
 * Say something, once what is being said has ended.
 * @param {string} text
 */
export function announce(text) {
  const region = part('announcer');
  region.append(h('p', {}, text)); // a new element is said, too, where its text is an old one
  while (region.childElementCount > MOST_KEPT) region.firstElementChild?.remove();
}
