// What every interface has while it runs: what it prints, and its end; with the controls of a hand where it moves one.
import { h, replace, setText } from './dom.js';
import { HandPanel } from './hand_panel.js';
import { Lost } from './link.js';
import { OutputField } from './output_field.js';

const SAYS = { starting: 'is being started…', running: 'was started for this question', failed: 'could not be used', stopped: 'is being stopped' };

// `onEnd()`: the person has finished, or given up.
export class InterfacePanel {
  constructor(app, question, name, onEnd) {
    Object.assign(this, { app, question, name, onEnd });
    this.title = h('span', { class: 'dim' });
    this.lines = h('pre', { class: 'output-lines' });
    this.output = h('details', { class: 'card output', hidden: true }, h('summary', {}, h('strong', {}, 'Interface ', name), ' ', this.title), this.lines);
    this.problem = h('p', { class: 'problem', role: 'alert' });
    this.outcome = h('select', { 'aria-label': 'Outcome' }, question.supersede.map((choice) => h('option', { value: choice.outcome, selected: choice.outcome === 'succeeded' }, choice.outcome + ' → ' + choice.target)));
    this.why = h('input', { type: 'text', maxlength: 2000, placeholder: 'For the record (optional)', 'aria-label': 'For the record' });
    this.outputs = question.outputs.map((key) => new OutputField(key, question.userdata.find((item) => item.key === key), () => setText(this.problem, '')));
    this.finish = h('button', { class: 'primary finish', onclick: () => this.handOver() }, 'Done: the work is finished');
    this.quit = h('button', { class: 'quit', onclick: () => this.settle('give_up_interface', { why: this.why.value }) }, 'Give up');
    this.end = h('section', { class: 'card interface-end' }, h('h3', {}, 'When ', question.state, ' is done'), h('label', { class: 'outcome-row' }, h('span', { class: 'dim' }, 'The state ends with'), this.outcome),
      this.outputs.length > 0 && h('details', { class: 'outputs' }, h('summary', {}, 'Output userdata that the interface cannot tell itself'), this.outputs.map((output) => output.root)), this.why,
      h('div', { class: 'row' }, this.finish, this.quit), this.problem);
    this.place = h('div', { class: 'hand-place' });
    this.root = h('div', { class: 'interface-panel' }, this.place, this.end, this.output);
    this.update();
  }

  stop() {
    if (this.hand) this.hand.stop();
    this.hand = null;
  }

  update() {
    const moves = this.question.key in (this.app.store.get('hand') || {});
    if (moves && !this.hand) {
      this.hand = new HandPanel(this.app, this.question);
      replace(this.place, this.hand.root);
    } else if (this.hand) {
      this.hand.update();
    }
    this.end.hidden = this.question.key in ((this.app.store.get('eye') || {}).perception || {}); // that one has its own
    this.finish.disabled = this.quit.disabled = !this.app.mayAnswer || this.busy;
    this.showOutput((this.app.store.get('output') || {})[this.question.key]);
  }

  showOutput(output) {
    this.output.hidden = !output;
    if (!output) return;
    setText(this.title, SAYS[output.status] || '');
    const text = [output.text, ...output.lines].join('\n');
    if (this.shown === text) return;
    const below = this.lines.scrollHeight - this.lines.scrollTop - this.lines.clientHeight < 30;
    this.shown = text;
    setText(this.lines, text);
    if (below) this.lines.scrollTop = this.lines.scrollHeight;
  }

  handOver() {
    let outputs;
    try {
      outputs = this.outputs.map((output) => output.read()).filter(Boolean);
    } catch (err) {
      setText(this.problem, err.message);
      return;
    }
    this.settle('hand_over', { outcome: this.outcome.value, outputs, why: this.why.value });
  }

  async settle(command, said) {
    if (this.busy) return;
    this.busy = true;
    setText(this.problem, '');
    this.update();
    try {
      const reply = await this.app.link.request(command, Object.assign({ question: this.question.key }, said));
      if (reply.ok) this.onEnd();
      else setText(this.problem, reply.message);
    } catch (err) {
      if (!(err instanceof Lost)) throw err;
      setText(this.problem, 'The connection was lost before the robot had confirmed; try again.');
    }
    this.busy = false;
    this.update();
  }
}
