// The preconditions of a state, in the order in which they run, and how each stands now.
import { h, setText } from './dom.js';
import { duration } from './format.js';

const STALE_S = 8;
const WORDS = { true: ['✓', 'holds', 'good'], false: ['✗', 'does not hold', 'bad'], null: ['?', 'unknown', ''] };

export class Preconditions {
  constructor(names) {
    this.items = names.map((name) => {
      const sign = h('span', { class: 'sign', 'aria-hidden': 'true' });
      const word = h('span', { class: 'word' });
      const why = h('span', { class: 'why' });
      const root = h('span', { class: 'precondition' }, sign, h('span', {}, name), ' ', word, why);
      return { root, sign, word, why };
    });
    this.age = h('span', { class: 'dim age' });
    this.root = h('span', { class: 'preconditions' }, 'preconditions', this.age, this.items.map((item) => item.root)); // a line each from the first: what is below stays where it is
  }

  // Nothing but their names where the robot tells nothing. `checks`: [{name, holds, text, looked}] in the same order.
  show(checks, now) {
    const oldest = Math.min(...(checks || []).map((check) => (check.looked === null ? Infinity : check.looked)));
    const age = now - oldest;
    const stale = checks && age > STALE_S;
    this.items.forEach((item, index) => {
      const check = checks && checks[index];
      const [sign, word, kind] = WORDS[String(check ? check.holds : null)];
      setText(item.sign, check ? sign : '');
      setText(item.word, check ? word : '');
      const shown = 'precondition ' + (check ? kind : '') + (stale ? ' stale' : '');
      if (item.root.className !== shown) item.root.className = shown;
      setText(item.why, check && check.holds !== true && check.text ? ': ' + (check.text.startsWith(check.name + ' ') ? check.text.slice(check.name.length + 1) : check.text).replace('running ' + check.name + ' ', 'running it ') : '');
    });
    setText(this.age, checks && oldest < Infinity ? (age < 1 ? 'as of now' : 'as of ' + duration(age) + ' ago') : '');
  }
}
