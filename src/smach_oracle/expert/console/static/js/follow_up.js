// What the robot does after an answer.
import { h, redraw, setText } from './dom.js';
import { added } from './format.js';

const TOLD = new Set(['jump', 'supersede', 'give_up', 'interface_start', 'interface_end', 'precondition_start', 'precondition_end', 'warning', 'state_start', 'transition', 'failure', 'trial_end', 'query_opened']);
const LONGEST = 8;
const SILENCE_S = 6;

export class FollowUp {
  constructor(app, question, onLeave) {
    this.app = app;
    this.question = question;
    this.steps = h('ol', { class: 'steps' });
    this.hint = h('p', { class: 'dim' });
    this.next = h('button', { class: 'primary', onclick: onLeave }, 'Back to the list');
    this.title = h('h3', { class: 'done' });
    this.root = h('div', { class: 'follow-up', role: 'status' }, this.title, this.steps, this.hint, h('div', { class: 'row' }, this.next));
    app.store.onEvents((message) => this.take(message));
    this.events = [];
  }

  begin(answer) {
    const words = { goto: 'go to ' + answer.name, supersede: this.question.state + ' counts as done, with ' + answer.name,
      give_up: 'give up' + (answer.name ? ' with ' + answer.name : ''), interface: 'interface ' + answer.name };
    setText(this.title, '✓ The robot has your answer: ' + words[answer.kind]);
    setText(this.hint, 'Waiting for what it does…');
    this.since = Date.now();
    this.watch();
  }

  watch() {
    this.events = [];
    this.app.link.request('watch', { trial: this.question.trial }).catch(() => {});
  }

  take(message) {
    if (!this.since || message.trial !== this.question.trial || message.from > this.events.length) return;
    this.events = this.events.slice(0, message.from).concat(message.events);
    const answered = this.events.findIndex((event) => event.kind === 'query_answered' && event.query === this.question.id);
    if (answered < 0) return;
    const told = this.events.slice(answered + 1).filter((event) => TOLD.has(event.kind)).slice(0, LONGEST);
    redraw(this.steps, told.map((event) => h('li', { class: event.kind }, event.words || event.kind, h('span', { class: 'dim' }, added(event)))));
    const again = told.find((event) => event.kind === 'query_opened');
    setText(this.hint, again ? 'It asks again; the question is in the list.' : '');
  }

  update() {
    if (this.since && !this.steps.childElementCount && Date.now() - this.since > SILENCE_S * 1000) {
      setText(this.hint, 'What it does next is not known: nothing is heard on ' + this.question.robot + '/oracle/events.');
    }
  }
}
