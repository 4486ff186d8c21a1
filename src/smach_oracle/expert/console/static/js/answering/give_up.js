// @ts-check
// Giving up ends the task: it is asked for, confirmed, and can be undone for some seconds before it
// is sent.
import { h, replace, setText } from '../page/dom.js';
import { focusIsFree, moveFocus } from '../page/focus.js';

/**
 * Makes a button of the form: the outcome, its key, its words, and what it asks. It sends nothing.
 * @typedef {(outcome: string, key: string, words: page.Child,
 *   act: () => void) => HTMLButtonElement} MakeButton
 */

const UNDO_S = 5;

export class GiveUp {
  /**
   * @param {server.Question} question
   * @param {MakeButton} makeButton
   * @param {{ send: (outcome: string, container: string) => void, begin: () => void,
   *   changed: () => void }} use `begin`: it was confirmed; `changed`: whether it is about to be
   *   sent
   */
  constructor(question, makeButton, use) {
    this.question = question;
    this.use = use;
    this.timer = 0;
    this.left = 0; // s until it is sent; 0 where nothing is about to be
    this.outcome = ''; // '': as the failure would have ended it
    this.container = ''; // that ends; '': that of the failed state
    this.choices = h('div', { class: 'give-up-choices' }, this.buildChoices(makeButton));
    this.asking = h('div', { class: 'give-up-asking', role: 'group', 'aria-label': 'Give up',
      hidden: true });
    this.root = h('div', { class: 'give-up-part' }, h('h4', {}, 'Give up'), this.choices,
      this.asking);
  }

  /** Whether it is confirmed, and will be sent in some seconds. */
  get counting() { return this.left > 0; }

  /**
   * @param {MakeButton} makeButton
   * @returns {page.Child}
   */
  buildChoices(makeButton) {
    const { path, give_up: outcomes, running } = this.question;
    const asFailed = [h('strong', {}, running ? 'as a failure' : 'as the failure',
      ' would have ended ', path)];
    const others = outcomes.map((outcome) => makeButton(outcome, '',
      h('strong', {}, 'with ', outcome), () => this.ask(outcome)));
    const above = this.question.give_up_above.map(({ container, outcome }) => {
      const button = makeButton(outcome, '', h('strong', {}, container, ' with ', outcome),
        () => this.ask(outcome, container));
      button.dataset['container'] = container;
      return button;
    });
    return [h('div', { class: 'choices' }, makeButton('', 'g', asFailed, () => this.ask(''))),
      others.length > 0 && h('details', { class: 'other-ends' },
        h('summary', {}, 'Give up, and say that ', path, ' has ended otherwise'),
        h('div', { class: 'choices short' }, others)),
      above.length > 0 && h('details', { class: 'ends-above' },
        h('summary', {}, 'End a container above ', path),
        h('div', { class: 'choices short' }, above))];
  }

  /**
   * @param {string} outcome
   * @param {string} [container] above that of the failed state
   */
  ask(outcome, container = '') {
    this.outcome = outcome;
    this.container = container;
    const back = h('button', { 'data-action': 'keep', onclick: () => this.cancel() },
      'No, go back');
    replace(this.asking, h('p', {}, 'Give up? ', this.consequence()),
      h('div', { class: 'row wrap' },
        h('button', { class: 'danger', 'data-action': 'confirm-give-up',
          'data-deliberate': 'confirm giving up', onclick: () => this.count() }, 'Yes, give up'),
        back));
    this.turn(true);
    back.focus();
  }

  consequence() {
    const { state } = this.question;
    const path = this.container || this.question.path;
    return this.outcome
      ? 'The work of ' + state + ' stays undone, and ' + path + ' ends with ' + this.outcome + '.'
      : 'The work of ' + state + ' stays undone, and ' + path
        + ' ends as the failure would have ended it.';
  }

  /** Confirmed: wait for an undo. */
  count() {
    this.use.begin();
    this.left = UNDO_S;
    const words = h('p', { role: 'status' });
    const undo = h('button', { class: 'primary', 'data-action': 'undo-give-up',
      onclick: () => this.cancel() }, 'Undo');
    replace(this.asking, words, h('div', { class: 'row' }, undo));
    undo.focus();
    const show = () => setText(words, 'Giving up in ' + this.left + ' s. ' + this.consequence());
    show();
    this.timer = setInterval(() => {
      this.left -= 1;
      if (this.left > 0) show();
      else this.send();
    }, 1000);
    this.use.changed();
  }

  send() {
    const { outcome, container } = this;
    this.cancel();
    this.use.send(outcome, container);
  }

  /** Back to the choices; whether there was anything to take back. */
  cancel() {
    const { counting } = this;
    const asked = !this.asking.hidden;
    const free = asked && focusIsFree(this.asking);
    clearInterval(this.timer);
    this.left = 0;
    this.turn(false);
    if (counting) this.use.changed();
    if (free) this.focusChoice();
    return asked;
  }

  /** Back to what was pressed first. */
  focusChoice() {
    const choices = /** @type {HTMLElement[]} */ ([...this.choices.querySelectorAll('button')]);
    const pressed = choices.find(({ dataset }) => (dataset['name'] === this.outcome
      && (dataset['container'] || '') === this.container));
    if (pressed) moveFocus(pressed);
  }

  /** @param {boolean} asking */
  turn(asking) {
    this.asking.hidden = !asking;
    this.choices.hidden = asking;
  }
}
