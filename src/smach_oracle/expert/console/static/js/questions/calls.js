// @ts-check
// Whom the console has called about a question, who comes next, and who could not be reached.
import { clock, counted, duration } from '../page/format.js';

/** @type {server.Reach} */
const NOBODY = { calls: {}, next: {}, failed: [] };
const AND = new Intl.ListFormat('en');

/**
 * Who could not be reached lately, for whoever looks at the list.
 * @param {page.App} app
 */
export function unreachedWords({ store }) {
  const failed = store.get('reach')?.failed || [];
  const last = failed[failed.length - 1];
  return last ? 'Not reached at ' + clock(last.at) + ': ' + last.to + ', ' + last.why
    + (failed.length > 1 ? ', and ' + counted(failed.length - 1, 'call') + ' before.' : '.') : '';
}

/**
 * Who was called about a question, and who comes next.
 * @param {page.App} app
 * @param {string} key of the question
 */
export function callsWords({ store }, key) {
  const { calls, next } = store.get('reach') || NOBODY;
  const now = store.now();
  const made = (calls[key] || []).map((call) => callWords(call, now));
  const coming = next[key];
  const words = made.length ? ['Called: ' + made.join(', ') + '.'] : [];
  if (coming) words.push(comingWords(coming, now));
  return words.join(' ');
}

/**
 * @param {server.Call} call
 * @param {number} now
 */
function callWords({ to, status, why, at }, now) {
  if (status === 'sent') return to + ' ' + duration(now - at) + ' ago';
  if (status === 'dropped') return to + ' no longer, since somebody came';
  if (status === 'failed') return to + ' was not reached (' + why + ')';
  return to + (why ? ' not yet (' + why + ')' : ' now');
}

/**
 * @param {server.NextCall} next
 * @param {number} now
 */
function comingWords({ people, at }, now) {
  return 'Next, unless somebody comes: ' + AND.format(people)
    + (at > now ? ' in ' + duration(at - now) : ' now') + '.';
}
