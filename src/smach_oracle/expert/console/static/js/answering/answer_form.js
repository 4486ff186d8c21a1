// @ts-check
// Everything that may be answered, each a button: one press sends it, but for giving up. Keys: 1 to
// 9 a state, s the outcome that says that the work is done, i the first interface, g asks whether
// to give up.
import { h, setText } from '../page/dom.js';
import { focusIsFree, moveFocus } from '../page/focus.js';
import { chip } from '../page/format.js';
import { keep, renderWith } from '../page/redraw.js';
import { GiveUp } from './give_up.js';
import { MEANINGS, successOf } from './outcome_choices.js';
import { outputFields, readOutputs } from './output_field.js';
import { ageWords, preconditionList } from './precondition_list.js';
import { justFailed, likeliest, stateLines } from './state_choices.js';

/** @typedef {{ [state: string]: server.PreconditionStatus[] | undefined }} AllStatuses by state */

const MOST_AT_ONCE = 12; // states
const MOST_OPEN = 2; // outputs
const REASON = 'Reason, for the record';
/**
 * @typedef {object} Looks of a button
 * @property {string} [container] of a state or an end that is another container's
 * @property {string} [looks] classes
 * @property {boolean} [blocked]
 * @property {() => void} [ask] comes before it is sent
 */

export class AnswerForm {
  /**
   * @param {server.Question} question
   * @param {(answer: server.Answer) => void} onAnswer
   * @param {() => void} onBegin a person begins an answer that is not sent yet
   */
  constructor(question, onAnswer, onBegin) {
    this.question = question;
    this.onAnswer = onAnswer;
    this.onBegin = onBegin;
    this.on = false;
    /** @type {AllStatuses} */
    this.statuses = {};
    this.now = 0; // by the server's clock
    this.filters = ['', '']; // of the folded states: those of the container, those of others
    this.sentFrom = { kind: '', name: '', container: '' }; // what was pressed last
    this.why = h('input', { type: 'text', class: 'why', maxlength: 2000,
      placeholder: REASON + ' (optional)', 'aria-label': REASON });
    this.problem = h('p', { class: 'problem', role: 'alert' });
    this.outputs = outputFields(question, () => setText(this.problem, ''));
    this.outputBox = h('details', { class: 'outputs', open: this.outputs.length <= MOST_OPEN },
      h('summary', {}, 'Its output userdata'), this.outputs.map((output) => output.root));
    this.giveUp = new GiveUp(this);
    this.root = h('div', {});
    this.root.addEventListener('input', ({ target }) => {
      if (!(target instanceof Element && target.matches('.state-filter'))) onBegin();
    });
    this.draw();
  }

  /**
   * Show it as it stands.
   * @param {boolean} on whether an answer may begin
   * @param {AllStatuses} statuses whether the preconditions of states hold
   * @param {number} now by the server's clock
   */
  show(on, statuses, now) {
    Object.assign(this, { on, statuses, now });
    if (on || !this.giveUp.cancel()) this.draw();
  }

  draw() {
    const { on, statuses, now, filters, giveUp } = this;
    const { asking, left, outcome, container } = giveUp;
    const ages = Object.values(statuses).map((each) => ageWords(each, now));
    renderWith(this.root, [on, statuses, ages, filters, asking, left, outcome, container], () => (
      h('div', { class: 'answer-form' }, this.goTo(), this.interfaces(), this.supersede(),
        giveUp.view(), keep(this.problem), keep(this.why))));
  }

  /** @param {string} selector */
  find(selector) {
    return /** @type {HTMLElement | null} */ (this.root.querySelector(selector));
  }

  /** Take back what is asked or about to be sent; whether there was any such thing. */
  cancel() { return this.giveUp.cancel(); }

  /** @param {string} key */
  press(key) { this.find('.choice[data-shortcut="' + CSS.escape(key) + '"]')?.click(); }

  /**
   * @param {server.AnswerKind} kind
   * @param {string} name
   * @param {string} [container] of a state or an outcome that is another container's
   */
  send(kind, name, container = '') {
    this.sentFrom = { kind, name, container };
    const outputs = readOutputs(kind === 'supersede' ? this.outputs : [], this.problem);
    if (outputs) this.onAnswer({ kind, name, container, outputs, why: this.why.value });
  }

  /**
   * @param {string} kind
   * @param {string} name
   * @param {string} container
   */
  buttonOf(kind, name, container) {
    const all = /** @type {HTMLElement[]} */ ([...this.root.querySelectorAll('.choice')]);
    return all.find(({ dataset }) => (dataset['kind'] === kind && dataset['name'] === name
      && (dataset['container'] || '') === container));
  }

  /** It was not taken: a button that is disabled meanwhile has lost the focus. */
  takeFocusBack() {
    const { kind, name, container } = this.sentFrom;
    const pressed = this.buttonOf(kind, name, container);
    if (pressed && focusIsFree(this.root)) moveFocus(pressed);
  }

  /**
   * One button.
   * @param {server.AnswerKind} kind
   * @param {string} name of the state, outcome or interface
   * @param {string} key that presses it, '' for none
   * @param {page.Child} words
   * @param {Looks} looks
   */
  choice(kind, name, key, words, { container = '', looks = '', blocked = false, ask } = {}) {
    const which = (container ? container + '/' : '') + name;
    return h('button', { key: kind + ' ' + which, class: 'choice ' + kind + looks, type: 'button',
      'data-kind': kind, 'data-name': name, 'data-container': container || null,
      'data-shortcut': key || null, 'data-deliberate': ask ? null : kind + ' ' + which,
      disabled: !this.on || this.giveUp.counting || blocked,
      onclick: ask || (() => this.send(kind, name, container)) },
    h('kbd', {}, key), h('span', { class: 'choice-text' }, words));
  }

  /** @returns {page.Child} */
  goTo() {
    const { choices: all, state, running } = this.question;
    const choices = all.filter(({ container }) => !container);
    const elsewhere = all.filter(({ container }) => container);
    const first = choices.length <= MOST_AT_ONCE ? choices : likeliest(this.question);
    const rest = choices.filter((choice) => !first.includes(choice));
    return [h('h4', {}, 'Go to', running && h('span', { class: 'dim' },
      ' · every answer but to wait on preempts ', state)),
    choicesBox(first.map((choice, index) => this.state(choice, String(index + 1)))),
    rest.length > 0 && this.folded(rest, 0, rest.length + ' more states'),
    elsewhere.length > 0 && h('div', { class: 'elsewhere' }, this.folded(elsewhere, 1,
      elsewhere.length === 1 ? '1 state of another container'
        : elsewhere.length + ' states of other containers'))];
  }

  /**
   * States in a list that is opened on demand.
   * @param {server.StateChoice[]} choices
   * @param {0 | 1} which
   * @param {string} title
   */
  folded(choices, which, title) {
    const wanted = this.filters[which];
    return h('details', { class: 'all-states' }, h('summary', {}, title),
      h('input', { type: 'search', class: 'state-filter', placeholder: 'Part of a name',
        'aria-label': 'States whose name has', oninput: ({ target }) => {
          this.filters[which] = target instanceof HTMLInputElement
            ? target.value.trim().toLowerCase() : '';
          this.draw();
        } }),
      choicesBox(choices.filter(({ state, container }) => (
        (container + '/' + state).toLowerCase().includes(wanted)))
        .map((choice) => this.state(choice, ''))));
  }

  /**
   * @param {server.StateChoice} choice
   * @param {string} key
   */
  state(choice, key) {
    const { state, container, preconditions, blocked } = choice;
    const statuses = container ? undefined : this.statuses[state];
    const words = stateLines(choice, this.question);
    if (preconditions.length && !container) {
      words.push(preconditionList(preconditions, statuses, this.now));
    }
    const doubtful = statuses?.some(({ holds }) => holds === false) ? ' doubtful' : '';
    // the estimate is of a state whose preconditions hold
    const unmet = justFailed(choice, this.question) ? ' unmet' : '';
    return this.choice('goto', state, key, words,
      { container, looks: doubtful + unmet, blocked: Boolean(blocked) });
  }

  /** @returns {page.Child} */
  interfaces() {
    const { interfaces } = this.question;
    return interfaces.length > 0 && [h('h4', {}, 'Do it through an interface'),
      choicesBox(interfaces.map(({ name, description }, index) => (
        this.choice('interface', name, index ? '' : 'i', [h('strong', {}, name),
          description && h('span', { class: 'dim' }, description)]))))];
  }

  /** @returns {page.Child} */
  supersede() {
    const { supersede, state } = this.question;
    return supersede.length > 0 && [h('h4', {}, 'I have done the work of ', state),
      this.outputs.length > 0 && keep(this.outputBox),
      choicesBox(supersede.map((choice) => this.outcome(choice)), 'short')];
  }

  /** @param {server.OutcomeChoice} choice */
  outcome(choice) {
    const { outcome, target, meaning } = choice;
    const key = choice === successOf(this.question.supersede) ? 's' : '';
    const words = MEANINGS[meaning];
    return this.choice('supersede', outcome, key, [h('strong', {}, outcome),
      h('span', { class: 'dim' }, '→ ', target), words && chip(words, 'bad')]);
  }
}

/**
 * @param {HTMLButtonElement[]} buttons
 * @param {string} [kind]
 */
function choicesBox(buttons, kind) {
  return h('div', { class: 'choices' + (kind ? ' ' + kind : '') }, buttons);
}
