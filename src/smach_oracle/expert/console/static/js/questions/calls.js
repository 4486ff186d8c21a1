// @ts-check
// Whom the console has called about a question, who comes next, and who could not be reached.
import { h, setText } from '../page/dom.js';
import { clock, counted, duration } from '../page/format.js';

const AND = new Intl.ListFormat('en');

export class Calls {
  /**
   * @param {page.App} app
   * @param {string} key of the question
   */
  constructor(app, key) {
    this.app = app;
    this.key = key;
    this.root = h('p', { class: 'dim calls', hidden: true });
    this.show();
  }

  show() {
    const { store } = this.app;
    const reach = store.get('reach');
    const words = reach ? wordsOf(reach, this.key, store.now()) : '';
    this.root.hidden = !words;
    setText(this.root, words);
  }
}

/** Who could not be reached lately, for whoever looks at the list. */
export class Unreached {
  /** @param {page.App} app */
  constructor(app) {
    this.app = app;
    this.root = h('p', { class: 'problem unreached', role: 'status', hidden: true });
  }

  show() {
    const failed = this.app.store.get('reach')?.failed || [];
    const last = failed[failed.length - 1];
    this.root.hidden = !last;
    setText(this.root, last ? 'Not reached at ' + clock(last.at) + ': ' + last.to + ', '
      + last.why + (failed.length > 1 ? ', and ' + counted(failed.length - 1, 'call')
      + ' before.' : '.') : '');
  }
}

/**
 * @param {server.Reach} reach
 * @param {string} key
 * @param {number} now
 */
function wordsOf({ calls, next }, key, now) {
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
