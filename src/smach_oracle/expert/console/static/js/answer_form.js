// Everything that may be answered, each a button: one press sends it. Keys: 1 to 9 a state, s the first supersede,
// i the first interface, g give up.
import { h, whenLetGo } from './dom.js';
import { CLASSES, breakable, chip, percent, rateBar } from './format.js';
import { OutputField } from './output_field.js';
import { Preconditions } from './preconditions.js';

const MOST_AT_ONCE = 12;
const LIKELIEST = 6;

// Of very many states those that are chosen most: what has helped, the failed one, where its success leads, and whence the machine came.
function likeliest({ choices, state, supersede, history }) {
  const helped = choices.filter((choice) => choice.helped[0] > 0).sort((one, other) => other.helped[0] / other.helped[1] - one.helped[0] / one.helped[1]).slice(0, 2);
  const came = history.filter((visit) => visit.result === 'success').reverse();
  const named = [...helped.map((choice) => choice.state), state, ...supersede.map((choice) => choice.target), ...came.map((visit) => visit.state)];
  const found = new Set(named.map((name) => choices.find((choice) => choice.state === name)).filter(Boolean));
  return choices.filter((choice) => [...found].slice(0, LIKELIEST).includes(choice));
}

export class AnswerForm {
  // `onAnswer({kind, name, outputs, why})`
  constructor(question, onAnswer) {
    this.question = question;
    this.onAnswer = onAnswer;
    this.buttons = [];
    this.keys = new Map();
    this.standings = new Map();
    this.why = h('input', { type: 'text', class: 'why', maxlength: 2000, placeholder: 'Reason, for the record (optional)', 'aria-label': 'Reason, for the record' });
    this.problem = h('p', { class: 'problem', role: 'alert' });
    this.outputs = question.outputs.map((key) => new OutputField(key, question.userdata.find((item) => item.key === key), () => { this.problem.textContent = ''; }));
    this.root = h('div', { class: 'answer-form' }, this.states(), this.interfaces(), this.supersede(), this.giveUp(), this.problem, this.why);
    this.enable(false);
  }

  enable(on) {
    for (const button of this.buttons) button.disabled = !on || button.dataset.blocked === 'yes';
  }

  // How the preconditions stand, by state; `now`: the server's clock.
  stand(conditions, now) {
    whenLetGo(this.root, () => {
      for (const [state, standing] of this.standings) standing.show((conditions || {})[state], now);
    });
  }

  press(key) {
    const button = this.keys.get(key);
    if (button && !button.disabled) button.click();
  }

  send(kind, name) {
    let outputs = [];
    try {
      if (kind === 'supersede') outputs = this.outputs.map((output) => output.read()).filter(Boolean);
    } catch (err) {
      this.problem.textContent = err.message;
      return;
    }
    this.problem.textContent = '';
    this.onAnswer({ kind, name, outputs, why: this.why.value });
  }

  choice(kind, name, key, title, ...more) {
    const button = h('button', { class: 'choice ' + kind, type: 'button', 'data-kind': kind, 'data-name': name, onclick: () => this.send(kind, name) },
      h('kbd', {}, key || ''), h('span', { class: 'choice-text' }, title, more));
    if (key) this.keys.set(key, button);
    this.buttons.push(button);
    return button;
  }

  states() {
    const { choices } = this.question;
    if (choices.length <= MOST_AT_ONCE) return [h('h4', {}, 'Go to'), h('div', { class: 'choices' }, choices.map((choice, index) => this.state(choice, String(index + 1))))];
    const first = likeliest(this.question);
    const rest = choices.filter((choice) => !first.includes(choice)).map((choice) => this.state(choice, ''));
    const filter = h('input', { type: 'search', class: 'state-filter', placeholder: 'Part of a name', 'aria-label': 'States whose name has', oninput: () => {
      for (const button of rest) button.hidden = !button.dataset.name.toLowerCase().includes(filter.value.trim().toLowerCase());
    } });
    return [h('h4', {}, 'Go to'), h('div', { class: 'choices' }, first.map((choice, index) => this.state(choice, String(index + 1)))),
      h('details', { class: 'all-states' }, h('summary', {}, rest.length + ' more states'), filter, h('div', { class: 'choices' }, rest))];
  }

  state(choice, key) {
    const { state } = this.question;
    const button = this.choice('goto', choice.state, key,
      h('span', { class: 'row' }, h('strong', { class: 'ellipsis' }, breakable(choice.state, '_')), choice.state === state && chip('again', '', 'The state that failed'), h('span', { class: 'spacer' }),
        rateBar(1 - choice.success, choice.success, percent(choice.success) + ' ok')),
      h('span', { class: 'chips' }, CLASSES[choice.class] && chip(CLASSES[choice.class], 'class-' + choice.class),
        choice.blocked && chip('blocked: ' + choice.blocked, 'bad'),
        choice.missing.length > 0 && chip('missing: ' + choice.missing.join(', '), 'warn', 'Userdata that it needs and would not have'),
        choice.visits > 0 && chip(choice.visits + (choice.visits === 1 ? ' visit' : ' visits'), '', 'In this trial'),
        choice.helped[1] > 0 && chip('helped ' + choice.helped[0] + ' of ' + choice.helped[1], choice.helped[0] * 2 > choice.helped[1] ? 'good' : '', 'How often going there helped when ' + state + ' had failed, as far as this console saw')));
    if (choice.preconditions.length) {
      const standing = new Preconditions(choice.preconditions);
      this.standings.set(choice.state, standing);
      button.lastElementChild.append(standing.root);
    }
    if (choice.blocked) button.dataset.blocked = 'yes';
    return button;
  }

  interfaces() {
    const { interfaces } = this.question;
    return interfaces.length > 0 && [h('h4', {}, 'Do it through an interface'), h('div', { class: 'choices' }, interfaces.map((offer, index) =>
      this.choice('interface', offer.name, index ? '' : 'i', h('strong', {}, offer.name), offer.description && h('span', { class: 'dim' }, offer.description))))];
  }

  supersede() {
    const { supersede, state } = this.question;
    if (!supersede.length) return null;
    return [h('h4', {}, 'I have done the work of ', state), this.outputs.length > 0 && h('details', { class: 'outputs', open: this.outputs.length <= 2 },
      h('summary', {}, 'Its output userdata'), this.outputs.map((output) => output.root)),
    h('div', { class: 'choices short' }, supersede.map((choice, index) => this.choice('supersede', choice.outcome, index ? '' : 's',
      h('strong', {}, choice.outcome), h('span', { class: 'dim' }, '→ ', choice.target))))];
  }

  giveUp() {
    const { give_up: outcomes, path } = this.question;
    return [h('h4', {}, 'Give up'), h('div', { class: 'choices short' }, this.choice('give_up', '', 'g', h('strong', {}, 'as the failure would have ended ', path)),
      outcomes.map((outcome) => this.choice('give_up', outcome, '', h('strong', {}, 'with ', outcome))))];
  }
}
