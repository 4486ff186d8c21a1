// @ts-check
// Giving up ends the task: it is asked for, confirmed, and can be undone for some seconds before it
// is sent.
import { h } from '../page/dom.js';
import { focusIsFree, moveFocus } from '../page/focus.js';

/** @typedef {import('./answer_form.js').AnswerForm} AnswerForm */

const UNDO_S = 5;

export class GiveUp {
  /** @param {AnswerForm} form that it is a part of */
  constructor(form) {
    this.form = form;
    this.timer = 0;
    this.left = 0; // s until it is sent; 0 where nothing is about to be
    this.asking = false;
    this.outcome = ''; // '': as the failure would have ended it
    this.container = ''; // that ends; '': that of the failed state
  }

  /** Whether it is confirmed, and will be sent in some seconds. */
  get counting() { return this.left > 0; }

  view() {
    const { path, give_up: outcomes, give_up_above: above, running } = this.form.question;
    return h('div', { class: 'give-up-part' }, h('h4', {}, 'Give up'),
      h('div', { class: 'give-up-choices', hidden: this.asking },
        h('div', { class: 'choices' }, this.choice('', '', 'g', running ? 'as a failure'
          : 'as the failure', ' would have ended ', path)),
        outcomes.length > 0 && h('details', { class: 'other-ends' },
          h('summary', {}, 'Give up, and say that ', path, ' has ended otherwise'),
          h('div', { class: 'choices short' }, outcomes.map((outcome) => (
            this.choice(outcome, '', '', 'with ', outcome))))),
        above.length > 0 && h('details', { class: 'ends-above' },
          h('summary', {}, 'End a container above ', path),
          h('div', { class: 'choices short' }, above.map(({ container, outcome }) => (
            this.choice(outcome, container, '', container, ' with ', outcome)))))),
      this.asking && h('div', { class: 'give-up-asking', role: 'group', 'aria-label': 'Give up' },
        this.counting ? this.countView() : this.askView()));
  }

  /**
   * @param {string} outcome
   * @param {string} container
   * @param {string} key
   * @param {...string} words
   */
  choice(outcome, container, key, ...words) {
    return this.form.choice('give_up', outcome, key, h('strong', {}, words), { container,
      ask: () => this.ask(outcome, container) });
  }

  /** @returns {page.Child} */
  askView() {
    return [h('p', { key: 'ask' }, 'Give up? ', this.consequence()),
      h('div', { key: 'ask', class: 'row wrap' },
        h('button', { class: 'danger', 'data-action': 'confirm-give-up',
          'data-deliberate': 'confirm giving up', onclick: () => this.count() }, 'Yes, give up'),
        h('button', { 'data-action': 'keep', onclick: () => this.cancel() }, 'No, go back'))];
  }

  /** @returns {page.Child} */
  countView() {
    return [h('p', { key: 'count', role: 'status' },
      'Giving up in ' + this.left + ' s. ' + this.consequence()),
    h('div', { key: 'count', class: 'row' }, h('button', { class: 'primary',
      'data-action': 'undo-give-up', onclick: () => this.cancel() }, 'Undo'))];
  }

  consequence() {
    const { state, path } = this.form.question;
    return 'The work of ' + state + ' stays undone, and ' + (this.container || path)
      + (this.outcome ? ' ends with ' + this.outcome : ' ends as the failure would have ended it')
      + '.';
  }

  /**
   * @param {string} outcome
   * @param {string} [container] above that of the failed state
   */
  ask(outcome, container = '') {
    Object.assign(this, { outcome, container, asking: true });
    this.form.draw();
    this.form.find('[data-action=keep]')?.focus();
  }

  /** Confirmed: wait for an undo. */
  count() {
    this.form.onBegin();
    this.left = UNDO_S;
    this.timer = setInterval(() => {
      this.left -= 1;
      if (this.left > 0) this.form.draw();
      else this.send();
    }, 1000);
    this.form.draw();
    this.form.find('[data-action=undo-give-up]')?.focus();
  }

  send() {
    const { outcome, container } = this;
    this.cancel();
    this.form.send('give_up', outcome, container);
  }

  /** Back to the choices; whether there was anything to take back. */
  cancel() {
    const { asking, form, outcome, container } = this;
    if (!asking) return false;
    const box = form.find('.give-up-asking');
    const free = box && focusIsFree(box);
    clearInterval(this.timer);
    this.left = 0;
    this.asking = false;
    form.draw();
    const pressed = free && form.buttonOf('give_up', outcome, container);
    if (pressed) moveFocus(pressed);
    return true;
  }
}
