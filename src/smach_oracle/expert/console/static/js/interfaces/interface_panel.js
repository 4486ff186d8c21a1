// @ts-check
// What every interface has while it runs: what it prints, and its end; with the controls of a hand
// where it moves one.
import { outputFields, readOutputs } from '../answering/output_field.js';
import { h, setText } from '../page/dom.js';
import { keep, render } from '../page/redraw.js';
import { outcomeChoice, outcomeRow, settle } from './ending.js';
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
    this.name = name;
    this.lines = h('pre', { class: 'output-lines', tabindex: 0 });
    this.problem = h('p', { class: 'problem', role: 'alert' });
    this.outcome = outcomeChoice(question);
    this.outcomeRow = outcomeRow(this.outcome);
    this.why = h('input', { type: 'text', maxlength: 2000, placeholder: RECORD + ' (optional)',
      'aria-label': RECORD });
    this.outputs = outputFields(question, () => setText(this.problem, ''));
    this.root = h('div', {});
    this.draw();
  }

  view() {
    const { store, mayAnswer } = this.app;
    const { question: { key, state }, outputs, manipulation } = this;
    const output = store.get('interface_output')?.[key];
    const off = !mayAnswer || this.busy;
    return h('div', { class: 'interface-panel' },
      h('div', { class: 'manipulation-place' }, manipulation && keep(manipulation.root)),
      h('section', { class: 'card interface-end', // one that marks has an end of its own
        hidden: key in (store.get('sensors')?.perception || {}) },
      h('h3', {}, 'When ', state, ' is done'), keep(this.outcomeRow),
      outputs.length > 0 && h('details', { class: 'outputs' },
        h('summary', {}, 'Output userdata that the interface cannot tell itself'),
        outputs.map(({ root }) => keep(root))),
      keep(this.why), h('div', { class: 'row' },
        h('button', { class: 'primary finish', disabled: off, 'data-deliberate': 'finish',
          onclick: () => this.handOver() }, 'Done: the work is finished'),
        h('button', { class: 'quit', disabled: off, 'data-deliberate': 'give up',
          onclick: () => this.giveUp() }, 'Give up')), keep(this.problem)),
      h('details', { class: 'card output', hidden: !output },
        h('summary', {}, h('strong', {}, 'Interface ', this.name), ' ',
          h('span', { class: 'dim' }, output && STATUS[output.status])), keep(this.lines)));
  }

  stop() {
    if (this.manipulation) this.manipulation.stop();
    this.manipulation = null;
  }

  draw() {
    const { app, question } = this;
    if (this.manipulation) this.manipulation.draw();
    else if (question.key in (app.store.get('manipulation') || {})) {
      this.manipulation = new ManipulationPanel(app, question);
    }
    render(this.root, this.view());
    const output = app.store.get('interface_output')?.[question.key];
    if (output) this.print([output.text, ...output.lines].join('\n'));
  }

  /** @param {string} text at whose end whoever was there stays */
  print(text) {
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
    settle(this, 'hand_over', { question: this.question.key, outcome, outputs, why });
  }

  giveUp() {
    settle(this, 'give_up_interface', { question: this.question.key, why: this.why.value });
  }
}
