// @ts-check
// What every interface has while it runs: what it prints, and its end; with the controls of a hand
// where it moves one.
import { outputFields, readOutputs } from '../answering/output_field.js';
import { h, replace, setText } from '../page/dom.js';
import { outcomeChoice, outcomeRow, replyTo } from './ending.js';
import { ManipulationPanel } from './manipulation_panel.js';

/** @type {{ [status in server.InterfaceOutput['status']]: string }} */
const STATUS = { starting: 'is being started…', running: 'was started for this question',
  failed: 'could not be used', stopped: 'is being stopped', '': '' };
const RECORD = 'For the record';
const AT_THE_END = 30; // px from it

export class InterfacePanel {
  /**
   * @param {page.App} app
   * @param {server.Question} question
   * @param {string} name of the interface
   * @param {() => void} onEnd the person has finished, or given up
   */
  constructor(app, question, name, onEnd) {
    this.app = app;
    this.question = question;
    this.onEnd = onEnd;
    this.busy = false;
    /** @type {ManipulationPanel | null} */
    this.manipulation = null;
    this.printed = ''; // what is shown of the output
    this.title = h('span', { class: 'dim' });
    this.lines = h('pre', { class: 'output-lines', tabindex: 0 });
    this.output = h('details', { class: 'card output', hidden: true },
      h('summary', {}, h('strong', {}, 'Interface ', name), ' ', this.title), this.lines);
    this.problem = h('p', { class: 'problem', role: 'alert' });
    this.outcome = outcomeChoice(question);
    this.why = h('input', { type: 'text', maxlength: 2000, placeholder: RECORD + ' (optional)',
      'aria-label': RECORD });
    this.outputs = outputFields(question, () => setText(this.problem, ''));
    this.finish = h('button', { class: 'primary finish',
      'data-deliberate': 'finish', onclick: () => this.handOver() },
      'Done: the work is finished');
    this.quit = h('button', { class: 'quit', 'data-deliberate': 'give up',
      onclick: () => this.giveUp() }, 'Give up');
    this.end = this.buildEnd();
    this.place = h('div', { class: 'manipulation-place' });
    this.root = h('div', { class: 'interface-panel' }, this.place, this.end, this.output);
    this.update();
  }

  buildEnd() {
    const { outputs } = this;
    return h('section', { class: 'card interface-end' },
      h('h3', {}, 'When ', this.question.state, ' is done'), outcomeRow(this.outcome),
      outputs.length > 0 && h('details', { class: 'outputs' },
        h('summary', {}, 'Output userdata that the interface cannot tell itself'),
        outputs.map((output) => output.root)),
      this.why, h('div', { class: 'row' }, this.finish, this.quit), this.problem);
  }

  stop() {
    if (this.manipulation) this.manipulation.stop();
    this.manipulation = null;
  }

  update() {
    const { key } = this.question;
    const { store, mayAnswer } = this.app;
    if (this.manipulation) this.manipulation.update();
    else if (key in (store.get('manipulation') || {})) {
      this.manipulation = new ManipulationPanel(this.app, this.question);
      replace(this.place, this.manipulation.root);
    }
    this.end.hidden = key in (store.get('sensors')?.perception || {}); // that one has its own
    this.finish.disabled = this.quit.disabled = !mayAnswer || this.busy;
    this.showOutput(store.get('interface_output')?.[key]);
  }

  /** @param {server.InterfaceOutput | undefined} output */
  showOutput(output) {
    this.output.hidden = !output;
    if (!output) return;
    setText(this.title, STATUS[output.status]);
    const text = [output.text, ...output.lines].join('\n');
    if (this.printed === text) return;
    this.printed = text;
    const { scrollHeight, scrollTop, clientHeight } = this.lines;
    setText(this.lines, text);
    if (scrollHeight - scrollTop - clientHeight < AT_THE_END) {
      this.lines.scrollTop = this.lines.scrollHeight;
    }
  }

  handOver() {
    const outputs = readOutputs(this.outputs, this.problem);
    if (!outputs) return;
    const [outcome, why] = [this.outcome.value, this.why.value];
    this.settle('hand_over', { question: this.question.key, outcome, outputs, why });
  }

  giveUp() {
    this.settle('give_up_interface', { question: this.question.key, why: this.why.value });
  }

  /**
   * @template {'hand_over' | 'give_up_interface'} Name
   * @param {Name} command
   * @param {server.Commands[Name]} args
   */
  async settle(command, args) {
    if (this.busy) return;
    this.busy = true;
    setText(this.problem, '');
    this.update();
    const reply = await replyTo(this.app, this.problem, command, args);
    if (reply && reply.ok) this.onEnd();
    else if (reply) setText(this.problem, reply.message);
    this.busy = false;
    this.update();
  }
}
