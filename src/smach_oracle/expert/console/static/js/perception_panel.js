// Marking an object in the very frame of the failure: draw around it, refine, accept; the machine goes on.
import { drawPicture } from './camera_view.js';
import { h, replace, setText } from './dom.js';
import { FrameFeed } from './frame_feed.js';
import { Lost } from './link.js';
import { Marking } from './marking.js';
import { ObjectView } from './object_view.js';

const TOOLS = [['rectangle', '▭ Rectangle', 'Drag from corner to corner around the object'], ['free', '✎ Free region', 'Draw a line around the object'],
  ['object', '+ Object', 'Paint what belongs to it'], ['background', '− Background', 'Paint what does not belong to it']];
const COLOURS = { region: '#2f6bff', under: '#ffffffd0', mask: '#5b8cff66', edge: '#7fb0ff', object: '#3ddc84cc', background: '#ff5a52cc' };
const FULL = 1280; // px: the width asked for

// `onEnd(outcome)`: the expert has accepted an object ('' where the expert gave up).
export class PerceptionPanel {
  constructor(app, question, onEnd) {
    Object.assign(this, { app, question, onEnd });
    this.marking = new Marking();
    this.outlines = [];
    this.stamp = '';
    this.picture = h('canvas', { class: 'picture', width: 4, height: 3, 'aria-label': 'The frame to draw on' });
    this.overlay = h('canvas', { class: 'drawing', width: 4, height: 3 });
    this.note = h('p', { class: 'view-note', role: 'status' }, 'Waiting for the frame…');
    this.tools = new Map(TOOLS.map(([tool, text, title]) => [tool, h('button', { class: 'tool', 'data-tool': tool, title, onclick: () => this.take(tool) }, text)]));
    this.result = h('div', { class: 'marked', role: 'status' });
    this.problem = h('p', { class: 'problem', role: 'alert' });
    this.outcome = h('select', { 'aria-label': 'Outcome' }, question.supersede.map((choice) => h('option', { value: choice.outcome, selected: choice.outcome === 'succeeded' }, choice.outcome + ' → ' + choice.target)));
    this.buttons = { undo: this.button('Undo', () => this.undo()), clear: this.button('Clear', () => this.clear()), failed: this.button('Frame of the failure', () => this.useFrame('at_goal')),
      fresh: this.button('New frame', () => this.useFrame('fresh')), accept: this.button('Accept the object', () => this.accept(), 'primary accept'), quit: this.button('Give up', () => this.giveUp(), 'quit') };
    this.object = new ObjectView(app, () => this.sensors);
    this.root = this.build();
    this.take('rectangle');
    this.listen();
    this.feed = new FrameFeed(app, () => this.sensors.image, this.root,
      { width: FULL, every: 200, take: (answer, facts) => this.show(answer, facts), say: (text) => this.say(text) });
    this.refresh();
  }

  build() {
    const { undo, clear, failed, fresh, accept, quit } = this.buttons;
    return h('section', { class: 'card perception', 'aria-label': 'Mark the object' },
      h('div', { class: 'perception-head' }, h('h3', {}, 'Mark the object for ', this.question.state), h('span', { class: 'spacer' }), failed, fresh),
      h('div', { class: 'perception-body' },
        h('div', { class: 'screen' }, this.picture, this.overlay, this.note), this.object.root,
        h('div', { class: 'perception-side' }, h('div', { class: 'tool-row', role: 'toolbar' }, [...this.tools.values()]), h('div', { class: 'tool-row' }, undo, clear),
          this.result, this.problem, h('span', { class: 'spacer' }),
          h('div', { class: 'perception-end' }, this.question.supersede.length > 1 && h('label', { class: 'outcome-row' }, h('span', { class: 'dim' }, 'The state ends with'), this.outcome), accept, quit))));
  }

  button(text, onclick, kind) { return h('button', { class: kind || 'tool', onclick }, text); }

  stop() {
    this.feed.stop();
    this.object.stop();
  }

  // Numbers of the sensors of its frame and of the cloud of that, null before there are any.
  get sensors() { return ((this.app.store.get('eye') || {}).perception || {})[this.question.key] || { image: null, cloud: null }; }

  get may() { return this.app.mayAnswer && !this.over; }

  take(tool) {
    this.tool = tool;
    for (const [name, button] of this.tools) button.setAttribute('aria-pressed', name === tool);
  }

  say(text) {
    if (text === 'Nothing new comes.') return; // one frame is all there is to come
    setText(this.note, text && this.stamp ? '' : text);
    this.note.hidden = !this.note.textContent;
  }

  async show(answer, facts) {
    await drawPicture(this.picture, answer, facts.size);
    [this.overlay.width, this.overlay.height] = facts.size;
    if (this.stamp !== facts.stamp) {
      this.marking.clear();
      this.forget();
    }
    this.stamp = facts.stamp;
    this.root.classList.add('shown');
    this.refresh();
  }

  forget() {
    this.outlines = [];
    this.found = null;
    this.object.show(null);
    this.generation = (this.generation || 0) + 1; // an answer that is still on its way is about something else
    setText(this.problem, '');
  }

  listen() {
    const drawing = this.overlay;
    drawing.addEventListener('pointerdown', (event) => {
      if (!this.may || !this.stamp || !event.isPrimary || event.button) return;
      event.preventDefault();
      drawing.setPointerCapture(event.pointerId);
      const refining = this.tool === 'object' || this.tool === 'background';
      if (refining && !this.marking.drawn) {
        setText(this.problem, 'First draw a region around the object.');
        return;
      }
      this.marking.begin(this.tool, this.at(event), Math.max(2, Math.round(7 * this.scale)));
      if (!refining) this.forget();
      this.paint();
    });
    drawing.addEventListener('pointermove', (event) => {
      if (!this.marking.line) return;
      for (const each of event.getCoalescedEvents ? event.getCoalescedEvents() : []) this.marking.move(this.at(each));
      this.marking.move(this.at(event));
      this.paint();
    });
    drawing.addEventListener('pointerup', () => {
      if (this.marking.end()) this.cut();
      this.refresh();
    });
    drawing.addEventListener('pointercancel', () => {
      this.marking.line = null;
      this.refresh();
    });
  }

  // Pixels of the frame for one of the screen.
  get scale() { return this.overlay.width / (this.overlay.clientWidth || 1); }

  at(event) {
    const box = this.overlay.getBoundingClientRect();
    const place = (value, size) => Math.round(Math.min(Math.max(value, 0), 1) * (size - 1));
    return [place((event.clientX - box.left) / box.width, this.overlay.width), place((event.clientY - box.top) / box.height, this.overlay.height)];
  }

  paint() {
    const context = this.overlay.getContext('2d');
    context.clearRect(0, 0, this.overlay.width, this.overlay.height);
    this.marking.draw(context, this.scale, this.outlines, COLOURS);
  }

  // One cut at a time; what was drawn meanwhile is cut out next.
  async cut() {
    this.asked = performance.now();
    this.generation = (this.generation || 0) + 1;
    if (this.cutting) return;
    this.cutting = true;
    let done = 0;
    while (done !== this.generation && this.marking.drawn && !this.over) {
      done = this.generation;
      const reply = await this.ask('mark', { stamp: this.stamp, region: this.marking.region, strokes: this.marking.strokes });
      if (reply && done === this.generation) this.takeIn(reply);
    }
    this.cutting = false;
    this.refresh();
  }

  takeIn(reply) {
    this.outlines = (reply.data && reply.data.outlines) || [];
    this.found = reply.ok && reply.data ? reply.data : null;
    this.object.show(this.found && this.found.object);
    this.root.dataset.shownAfter = Math.round(performance.now() - this.asked);
    setText(this.problem, reply.ok ? '' : reply.message);
    this.warning = reply.ok ? reply.message : '';
    this.refresh();
  }

  undo() {
    if (this.marking.undo()) this.cut();
    else this.forget();
    this.refresh();
  }

  clear() {
    this.marking.clear();
    this.forget();
    this.refresh();
  }

  async useFrame(frame) {
    this.busy = true;
    this.clear();
    const reply = await this.ask('use_frame', { frame });
    this.busy = false;
    if (reply && !reply.ok) setText(this.problem, reply.message);
    this.refresh();
  }

  async accept() {
    await this.settle('hand_over', { outcome: this.outcome.value, why: '' }, this.outcome.value);
  }

  async giveUp() { await this.settle('give_up_interface', { why: '' }, ''); }

  async settle(command, said, outcome) {
    if (this.busy) return;
    this.busy = true;
    this.refresh();
    const reply = await this.ask(command, said);
    this.busy = false;
    if (reply && reply.ok) {
      this.over = true;
      this.onEnd(outcome);
    } else if (reply) {
      setText(this.problem, reply.message);
    }
    this.refresh();
  }

  // null where the connection was lost.
  async ask(command, said) {
    try {
      return await this.app.link.request(command, Object.assign({ question: this.question.key }, said));
    } catch (err) {
      if (!(err instanceof Lost)) throw err;
      setText(this.problem, 'The connection was lost before the robot had confirmed; try again.');
      return null;
    }
  }

  refresh() {
    this.paint();
    const { undo, clear, failed, fresh, accept, quit } = this.buttons;
    for (const button of [...this.tools.values(), failed, fresh, quit]) button.disabled = !this.may || this.busy;
    undo.disabled = clear.disabled = !this.may || !this.marking.drawn || this.busy;
    accept.disabled = !this.may || !this.found || this.busy || Boolean(this.cutting);
    const found = this.found && this.found.object;
    const key = JSON.stringify([this.found, this.marking.drawn, this.cutting, this.warning, this.may]);
    if (key === this.resultKey) return;
    this.resultKey = key;
    if (found) replace(this.result, facts(found, this.found.elapsed), this.warning && h('p', { class: 'dim' }, this.warning));
    else replace(this.result, h('p', { class: 'dim' }, !this.app.mayAnswer ? 'You are signed in as a viewer: operators mark objects.' : this.cutting ? 'Cutting it out…' : this.marking.drawn ? 'No object yet: refine, or draw again.' : 'Draw around the whole object, closely; the rest is cut out by itself.'));
  }
}

function facts(object, elapsed) {
  const cm = object.size.map((value) => (100 * value).toFixed(1)).join(' × ');
  const place = object.position.map((value, axis) => 'xyz'[axis] + ' ' + value.toFixed(3)).join('  ');
  return h('dl', {}, [['Size', cm + ' cm'], ['Centre', place + ' m'], ['Turned', Math.round(object.yaw * 180 / Math.PI) + '°'], ['In frame', object.frame], ['Points', object.points], ['Cut out in', Math.round(1000 * elapsed) + ' ms']]
    .map(([name, value]) => [h('dt', {}, name), h('dd', { class: 'number', 'data-fact': name.toLowerCase() }, value)]));
}
