// @ts-check
// Marking an object in the very image of the failure: draw around it, refine, accept; the machine
// goes on.
import { h, setText } from '../page/dom.js';
import { keep, render } from '../page/redraw.js';
import { drawImage } from '../sensors/image_canvas.js';
import { SensorFeed } from '../sensors/sensor_feed.js';
import { outcomeChoice, outcomeRow, replyTo, settle } from './ending.js';
import { markedFacts } from './marked_facts.js';
import { MarkingCanvas } from './marking_canvas.js';
import { ObjectView } from './object_view.js';

/** @typedef {import('./marking.js').Tool} Tool */

/** @type {{ tool: Tool, text: string, title: string }[]} */
const TOOLS = [
  { tool: 'rectangle', text: '▭ Rectangle', title: 'Drag from corner to corner around the object' },
  { tool: 'free', text: '✎ Free region', title: 'Draw a line around the object' },
  { tool: 'object', text: '+ Object', title: 'Paint what belongs to it' },
  { tool: 'background', text: '− Background', title: 'Paint what does not belong to it' },
];
const FULL = 1280; // px: the width asked for
const PERIOD_MS = 200;
const FIRST = 'First draw a region around the object.';
const VIEWER = 'You are signed in as a viewer: operators mark objects.';
const NOT_YET = 'No object yet: refine, or draw again.';
const DRAW = 'Draw around the whole object, closely; the rest is cut out by itself.';

export class PerceptionPanel {
  /**
   * @param {page.App} app
   * @param {server.Question} question
   * @param {() => void} onEnd an object was accepted, or the expert gave up
   */
  constructor(app, question, onEnd) {
    this.app = app;
    this.question = question;
    this.over = false;
    this.onEnd = () => {
      this.over = true;
      onEnd();
    };
    this.busy = false;
    this.cutting = false;
    this.stamp = ''; // of the image
    this.generation = 0; // of what is drawn
    this.askedMs = 0;
    /** @type {server.Marked | null} */
    this.marked = null;
    this.warning = '';
    this.image = h('canvas', { class: 'image', width: 4, height: 3, role: 'img',
      'aria-label': 'The image to draw on' });
    this.canvas = new MarkingCanvas(this);
    this.note = h('p', { class: 'view-note', role: 'status' }, 'Waiting for the image…');
    this.problem = h('p', { class: 'problem', role: 'alert' });
    this.outcome = outcomeChoice(question);
    this.outcomeRow = outcomeRow(this.outcome);
    this.head = h('div', {});
    this.side = h('div', {});
    this.object = new ObjectView(app, () => this.sensors);
    this.root = this.build();
    /** @type {SensorFeed<server.ImageFacts>} */
    this.feed = new SensorFeed(app, () => this.sensors.image, this.root,
      { width: FULL, every: PERIOD_MS, take: (answer, facts) => this.show(answer, facts),
        say: (text, missing) => this.say(text, missing) });
    this.draw();
  }

  build() {
    return h('section', { class: 'card perception', 'aria-label': 'Mark the object' }, this.head,
      h('div', { class: 'perception-body' },
        h('div', { class: 'screen' }, this.image, this.canvas.root, this.canvas.hint, this.note),
        this.object.root, this.side));
  }

  headView() {
    const off = { disabled: !this.may || this.busy };
    return h('div', { class: 'perception-head' },
      h('h3', {}, 'Mark the object for ', this.question.state), h('span', { class: 'spacer' }),
      h('div', { class: 'row' },
        button('Image of the failure', () => this.useFrame('at_goal'), off),
        button('New image', () => this.useFrame('fresh'), off)));
  }

  sideView() {
    const off = !this.may || this.busy;
    const drawn = Boolean(this.marking.region);
    return h('div', { class: 'perception-side' },
      h('div', { class: 'tool-row', role: 'toolbar', 'aria-label': 'Tools' },
        TOOLS.map(({ tool, text, title }) => button(text, () => this.take(tool), { title,
          'data-tool': tool, disabled: off, 'aria-pressed': tool === this.canvas.tool }))),
      h('div', { class: 'tool-row' },
        button('Undo', () => this.undo(), { disabled: off || !drawn }),
        button('Clear', () => this.clear(), { disabled: off || !drawn })),
      h('div', { class: 'marked', role: 'status' }, this.resultOf(drawn)), keep(this.problem),
      h('span', { class: 'spacer' }),
      h('div', { class: 'perception-end' },
        this.question.supersede.length > 1 && keep(this.outcomeRow),
        button('Accept the object', () => this.accept(), { class: 'primary accept',
          disabled: off || !this.marked || this.cutting, 'data-deliberate': 'accept' }),
        button('Give up', () => this.giveUp(), { class: 'quit', disabled: off,
          'data-deliberate': 'give up' })));
  }

  stop() {
    this.feed.stop();
    this.object.stop();
  }

  /** Numbers of the sensors of its image and of the cloud of that, null before there are any. */
  get sensors() {
    const running = this.app.store.get('sensors')?.perception || {};
    return running[this.question.key] || { image: null, cloud: null };
  }

  get may() { return this.app.mayAnswer && !this.over; }

  /** Whether somebody may draw now. */
  get mayDraw() { return this.may && Boolean(this.stamp); }

  /** The image has no region yet that could be corrected. */
  refuse() { setText(this.problem, FIRST); }

  get marking() { return this.canvas.marking; }

  /** @param {Tool} tool */
  take(tool) {
    this.canvas.tool = tool;
    this.draw();
  }

  /**
   * @param {string} text
   * @param {import('../sensors/sensor_feed.js').Missing} missing
   */
  say(text, missing) {
    if (missing === 'next') return; // one image is all there is to come
    setText(this.note, this.stamp ? '' : text);
  }

  /**
   * @param {Response} answer
   * @param {server.ImageFacts} facts
   */
  async show(answer, { size, stamp }) {
    await drawImage(this.image, answer, size);
    this.canvas.setSize(size);
    if (this.stamp !== stamp) {
      this.marking.clear();
      this.forget();
    }
    this.stamp = stamp;
    this.root.dataset['stamp'] = stamp;
    this.root.classList.add('shown');
    this.draw();
  }

  /** What was cut out is about something else. */
  forget() {
    this.canvas.outlines = [];
    this.marked = null;
    this.object.show(null);
    this.generation += 1; // so is a reply that is still on its way
    setText(this.problem, '');
  }

  /** Have it cut out. One cut at a time; what was drawn meanwhile is cut out next. */
  async cut() {
    this.askedMs = performance.now();
    this.generation += 1;
    if (this.cutting) return;
    this.cutting = true;
    let done = 0;
    while (done !== this.generation && this.marking.region && !this.over) {
      done = this.generation;
      const { region, strokes } = this.marking;
      const reply = await this.ask('mark',
        { question: this.question.key, stamp: this.stamp, region, strokes });
      if (reply && done === this.generation) this.takeIn(reply);
    }
    this.cutting = false;
    this.draw();
  }

  /** @param {server.Reply<'mark'>} reply */
  takeIn({ ok, message, data }) {
    this.canvas.outlines = data ? data.outlines : [];
    this.marked = ok && data ? data : null;
    this.object.show(this.marked?.object || null);
    this.root.dataset['shownAfter'] = String(Math.round(performance.now() - this.askedMs));
    setText(this.problem, ok ? '' : message);
    this.warning = ok ? message : '';
    this.draw();
  }

  undo() {
    if (this.marking.undo()) this.cut();
    else this.forget();
    this.draw();
  }

  clear() {
    this.marking.clear();
    this.forget();
    this.draw();
  }

  /** @param {'at_goal' | 'fresh'} frame */
  async useFrame(frame) {
    this.busy = true;
    this.clear();
    const reply = await this.ask('use_frame', { question: this.question.key, frame });
    this.busy = false;
    if (reply && !reply.ok) setText(this.problem, reply.message);
    this.draw();
  }

  accept() {
    settle(this, 'hand_over',
      { question: this.question.key, outcome: this.outcome.value, why: '' });
  }

  giveUp() { settle(this, 'give_up_interface', { question: this.question.key, why: '' }); }

  /**
   * null where the connection was lost.
   * @template {keyof server.Commands} Name
   * @param {Name} command
   * @param {server.Commands[Name]} args
   */
  ask(command, args) { return replyTo(this.app, this.problem, command, args); }

  draw() {
    this.canvas.paint();
    render(this.head, this.headView());
    render(this.side, this.sideView());
  }

  /**
   * @param {boolean} drawn
   * @returns {page.Child}
   */
  resultOf(drawn) {
    const { marked, warning } = this;
    return marked && marked.object ? [markedFacts(marked.object, marked.elapsed),
      warning && h('p', { class: 'dim' }, warning)] : h('p', { class: 'dim' }, this.hint(drawn));
  }

  /** @param {boolean} drawn */
  hint(drawn) {
    if (!this.app.mayAnswer) return VIEWER;
    if (this.cutting) return 'Cutting it out…';
    return drawn ? NOT_YET : DRAW;
  }
}

/**
 * @param {string} text
 * @param {() => void} onclick
 * @param {page.Properties} properties
 */
function button(text, onclick, properties) {
  return h('button', { key: text, class: 'tool', onclick, ...properties }, text);
}
