// @ts-check
// Everything that may be answered, each a button: one press sends it, but for giving up. Keys: 1 to
// 9 a state, s the outcome that says that the work is done, i the first interface, g asks whether
// to give up.
import { h, setText } from '../page/dom.js';
import { focusIsFree, moveFocus } from '../page/focus.js';
import { whenLetGo } from '../page/redraw.js';
import { chip } from '../page/format.js';
import { GiveUp } from './give_up.js';
import { MEANINGS, successOf } from './outcome_choices.js';
import { outputFields, readOutputs } from './output_field.js';
import { PreconditionList } from './precondition_list.js';
import { justFailed, likeliest, stateLines } from './state_choices.js';

const MOST_AT_ONCE = 12; // states
const MOST_OPEN = 2; // outputs
const REASON = 'Reason, for the record';

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
    /** @type {HTMLButtonElement[]} */
    this.buttons = [];
    /** @type {Map<string, HTMLButtonElement>} */
    this.keys = new Map();
    /** @type {Map<string, PreconditionList>} */
    this.preconditions = new Map(); // by state
    this.why = h('input', { type: 'text', class: 'why', maxlength: 2000,
      placeholder: REASON + ' (optional)', 'aria-label': REASON });
    this.problem = h('p', { class: 'problem', role: 'alert' });
    this.outputs = outputFields(question, () => setText(this.problem, ''));
    this.on = false;
    /** @type {HTMLButtonElement | undefined} */
    this.sentFrom = undefined; // what was pressed last
    this.giveUp = this.makeGiveUp();
    this.root = h('div', { class: 'answer-form' }, this.goTo(), this.interfaces(), this.supersede(),
      this.giveUp.root, this.problem, this.why);
    this.root.addEventListener('input', ({ target }) => {
      if (!(target instanceof Element && target.matches('.state-filter'))) onBegin();
    });
    this.enable(false);
  }

  /** @param {boolean} on */
  enable(on) {
    this.on = on;
    if (!on) this.giveUp.cancel();
    const may = on && !this.giveUp.counting;
    for (const button of this.buttons) {
      button.disabled = !may || button.dataset['blocked'] === 'yes';
    }
  }

  /** Take back what is asked or about to be sent; whether there was any such thing. */
  cancel() { return this.giveUp.cancel(); }

  /**
   * Whether the preconditions of states hold.
   * @param {{ [state: string]: server.PreconditionStatus[] | undefined }} statuses
   * @param {number} now by the server's clock
   */
  showPreconditions(statuses, now) {
    whenLetGo(this.root, () => {
      for (const [state, list] of this.preconditions) {
        list.show(statuses[state], now);
        const unmet = Boolean(statuses[state]?.some(({ holds }) => holds === false));
        list.root.closest('.choice')?.classList.toggle('doubtful', unmet);
      }
    });
  }

  /** @param {string} key */
  press(key) {
    const button = this.keys.get(key);
    if (button && !button.disabled) button.click();
  }

  /**
   * @param {server.AnswerKind} kind
   * @param {string} name
   * @param {string} [container] of a state or an outcome that is another container's
   */
  send(kind, name, container = '') {
    this.sentFrom = this.buttonOf(kind, name, container);
    const outputs = readOutputs(kind === 'supersede' ? this.outputs : [], this.problem);
    if (outputs) this.onAnswer({ kind, name, container, outputs, why: this.why.value });
  }

  /**
   * @param {server.AnswerKind} kind
   * @param {string} name
   * @param {string} container
   */
  buttonOf(kind, name, container) {
    return this.buttons.find(({ dataset }) => (dataset['kind'] === kind
      && dataset['name'] === name && (dataset['container'] || '') === container));
  }

  /** It was not taken: a button that is disabled meanwhile has lost the focus. */
  takeFocusBack() {
    if (this.sentFrom && focusIsFree(this.root)) moveFocus(this.sentFrom);
  }

  /**
   * One button.
   * @param {server.AnswerKind} kind
   * @param {string} name of the state, outcome or interface
   * @param {string} key that presses it, '' for none
   * @param {page.Child} words
   * @param {string} [container] of a state that is another container's
   * @param {() => void} [ask] comes before it is sent
   */
  choice(kind, name, key, words, container = '', ask = undefined) {
    const which = (container ? container + '/' : '') + name;
    const button = h('button', { class: 'choice ' + kind, type: 'button', 'data-kind': kind,
      'data-name': name, 'data-container': container || null,
      'data-deliberate': ask ? null : kind + ' ' + which,
      onclick: ask || (() => this.send(kind, name, container)) },
    h('kbd', {}, key), h('span', { class: 'choice-text' }, words));
    if (key) this.keys.set(key, button);
    this.buttons.push(button);
    return button;
  }

  /** @returns {page.Child} */
  goTo() {
    const choices = this.question.choices.filter(({ container }) => !container);
    const first = choices.length <= MOST_AT_ONCE ? choices : likeliest(this.question);
    const rest = choices.filter((choice) => !first.includes(choice));
    return [h('h4', {}, 'Go to', this.preemptHint()), choicesBox(first.map((choice, index) => (
      this.state(choice, String(index + 1))))), rest.length > 0 && this.otherStates(rest),
    this.elsewhere()];
  }

  /** @returns {page.Child} */
  elsewhere() {
    const choices = this.question.choices.filter(({ container }) => container);
    return choices.length > 0 && h('div', { class: 'elsewhere' },
      this.folded(choices, choices.length === 1 ? '1 state of another container'
        : choices.length + ' states of other containers'));
  }

  /** @returns {page.Child} */
  preemptHint() {
    const { state, running } = this.question;
    return running && h('span', { class: 'dim' },
      ' · every answer but to wait on preempts ', state);
  }

  /** @param {server.StateChoice[]} choices */
  otherStates(choices) { return this.folded(choices, choices.length + ' more states'); }

  /**
   * States in a list that is opened on demand.
   * @param {server.StateChoice[]} choices
   * @param {string} title
   */
  folded(choices, title) {
    const buttons = choices.map((choice) => this.state(choice, ''));
    const filter = h('input', { type: 'search', class: 'state-filter',
      placeholder: 'Part of a name', 'aria-label': 'States whose name has',
      oninput: () => {
        const wanted = filter.value.trim().toLowerCase();
        choices.forEach(({ state, container }, index) => {
          buttons[index].hidden = !(container + '/' + state).toLowerCase().includes(wanted);
        });
      } });
    return h('details', { class: 'all-states' }, h('summary', {}, title),
      filter, choicesBox(buttons));
  }

  /**
   * @param {server.StateChoice} choice
   * @param {string} key
   */
  state(choice, key) {
    const { state, container, preconditions, blocked } = choice;
    const words = stateLines(choice, this.question);
    if (preconditions.length && !container) {
      const list = new PreconditionList(preconditions);
      this.preconditions.set(state, list);
      words.push(list.root);
    }
    const button = this.choice('goto', state, key, words, container);
    if (blocked) button.dataset['blocked'] = 'yes';
    // the estimate is of a state whose preconditions hold
    button.classList.toggle('unmet', Boolean(justFailed(choice, this.question)));
    return button;
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
    const { outputs } = this;
    return supersede.length > 0 && [h('h4', {}, 'I have done the work of ', state),
      outputs.length > 0 && h('details', { class: 'outputs', open: outputs.length <= MOST_OPEN },
        h('summary', {}, 'Its output userdata'), outputs.map((output) => output.root)),
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

  makeGiveUp() {
    return new GiveUp(this.question,
      (outcome, key, words, ask) => this.choice('give_up', outcome, key, words, '', ask),
      { send: (outcome, container) => this.send('give_up', outcome, container),
        begin: () => this.onBegin(), changed: () => this.enable(this.on) });
  }
}

/**
 * @param {HTMLButtonElement[]} buttons
 * @param {string} [kind]
 */
function choicesBox(buttons, kind) {
  return h('div', { class: 'choices' + (kind ? ' ' + kind : '') }, buttons);
}
