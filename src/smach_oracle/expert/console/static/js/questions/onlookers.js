// @ts-check
// Who else looks at a question now.
import { h, say } from '../page/dom.js';

const PAUSE_MS = 1000; // turning the pages fast uses up no limit on commands
const ELSEWHERE = ' (in another browser)';
let wanted = ''; // the question that this page shows
let timer = 0;

export class Onlookers {
  /**
   * @param {page.App} app
   * @param {server.Question} question
   */
  constructor(app, question) {
    this.app = app;
    this.key = question.key;
    this.root = h('p', { class: 'dim onlookers', role: 'status', hidden: true });
  }

  /** Tell the others that this page shows the question. */
  look() { this.tell(this.key); }

  leave() { if (wanted === this.key) this.tell(''); }

  /** @param {string} question */
  tell(question) {
    const { connection } = this.app; // the timer holds nothing of what is shown
    wanted = question;
    timer = timer || setTimeout(() => {
      timer = 0;
      connection.request('view', { question: wanted }).catch(() => {});
    }, PAUSE_MS);
  }

  show() {
    const names = namesOf(this.app, this.key);
    say(this.root, names.length ? 'Also looking at it: ' + names.join(', ') + '.' : '');
  }
}

/**
 * The others who look at a question, each browser once.
 * @param {page.App} app
 * @param {string} key
 */
function namesOf(app, key) {
  const all = app.store.get('onlookers')?.[key] || [];
  const others = new Map(all.filter(({ session }) => session !== app.connection.browser)
    .map((each) => [each.session + ' ' + each.name, nameOf(app, each)]));
  return [...others.values()];
}

/**
 * The names of the others who look at a question, in short.
 * @param {page.App} app
 * @param {string} key
 */
export function readersOf(app, key) {
  return namesOf(app, key).map((name) => name.replace(ELSEWHERE, ''));
}

/**
 * @param {page.App} app
 * @param {server.Onlooker} onlooker
 */
function nameOf(app, { name, role }) {
  if (name) return name + (name === app.expert ? ELSEWHERE : '');
  return role === 'viewer' ? 'a viewer' : 'somebody without a name';
}
