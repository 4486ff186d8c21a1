// @ts-check
// Driving a robot's hand: hold to move, let go to stop. The server relays what is fresh only, and
// the robot has a watchdog.
import { vector } from '../drawing/transforms.js';
import { h, setText } from '../page/dom.js';
import { NO_EMERGENCY_STOP } from '../page/emergency.js';
import { remember, remembered } from '../page/preferences.js';
import { redraw, render } from '../page/redraw.js';
import { DriveInput } from './drive_input.js';
import { BUTTONS, MOTIONS, MOVES } from './drive_moves.js';
import { DriveViews } from './drive_views.js';
import { factsOf, lightOf } from './hand_state.js';
import { factRows } from './marked_facts.js';

/** @typedef {import('./drive_moves.js').Move} Move */
/** @typedef {import('./drive_moves.js').MoveKind} MoveKind */

const PERIOD_MS = 25;
const IDLE_MS = 500; // how often a page that holds the wheel says so while nothing moves
const FRAMES = { tool: 'Tool', base: 'Base', camera: 'Camera' };
const TITLES = { linear: 'Move', angular: 'Turn' };
const CANNOT_STOP = 'There is no connection: this page cannot stop it.';
const HOLD = 'Hold to move, let go to stop: with mouse or finger, with Enter or Space, or with the '
  + 'key that stands there. ';
const PAD = 'A gamepad moves while a shoulder button is held.';
/** @type {server.DriveWish} */
const NOTHING = { held: false, linear: [0, 0, 0], angular: [0, 0, 0], gripper: '' };
/** @type {server.Manipulation} */
const UNKNOWN = { frames: [], arms: [], boxes: null, wheel: null, driver: '' };

/** @param {string} name */
function frameOf(name) {
  return name === 'base' || name === 'camera' ? name : 'tool';
}

export class ManipulationPanel {
  /**
   * @param {page.App} app
   * @param {server.Question} question
   */
  constructor(app, question) {
    this.app = app;
    this.question = question;
    this.input = new DriveInput((held) => this.changed(held));
    this.sentMs = 0;
    this.arm = ''; // the one that the interface has chosen, until the person chooses
    /** @type {number | null} */
    this.wheel = null; // the number under which this page took it
    this.problem = h('p', { class: 'problem', role: 'alert' });
    /** @type {server.DriveFrame} */
    this.frame = frameOf(remembered('drive frame', 'tool'));
    this.scale = h('input', { type: 'range', min: 5, max: 100, step: 5,
      value: remembered('drive speed', '30'), oninput: () => this.showScale(),
      'aria-label': 'Speed, % of the interface\'s own limit' });
    this.scaleText = h('output', { class: 'number' });
    /** @type {Map<Move, HTMLButtonElement>} */
    this.pads = new Map(MOVES.map((move) => [move, this.pad(move)]));
    // each of its own: what is pressed in one holds up no other
    this.head = h('div', {});
    this.light = h('div', {});
    this.facts = h('dl', { class: 'drive-facts' });
    this.choices = h('div', {});
    this.views = new DriveViews(app, question.robot);
    this.hint = h('p', { class: 'dim hint' });
    this.root = this.build();
    this.showScale();
    this.showHeld(this.input.read());
    this.timer = setInterval(() => this.beat(), PERIOD_MS);
    this.draw();
  }

  build() {
    return h('section', { class: 'card manipulation', 'aria-label': 'Drive the hand' }, this.head,
      this.problem, h('p', { class: 'dim no-emergency-stop' }, NO_EMERGENCY_STOP),
      h('div', { class: 'manipulation-body' },
        h('div', { class: 'manipulation-see' }, this.light, this.views.root, this.facts),
        h('div', { class: 'manipulation-controls' }, this.choices,
          h('label', { class: 'row' },
            h('span', { class: 'dim' }, 'Speed'), this.scale, this.scaleText),
          h('h4', {}, TITLES.linear), this.padGroup('linear'),
          h('h4', {}, TITLES.angular), this.padGroup('angular'),
          h('h4', {}, 'Gripper'),
          h('div', { class: 'pads two', role: 'group', 'aria-label': 'Gripper' },
            this.pads.get('open'), this.pads.get('close')),
          this.hint)));
  }

  headView() {
    const { mine, manipulation: now } = this;
    const { connected } = this.app.connection;
    const may = this.app.role === 'teleoperator';
    const nobody = 'Nobody drives' + (may ? '.' : '; to drive needs the role of a teleoperator.');
    const driver = mine ? 'You drive.' : now && now.driver ? now.driver + ' drives.' : nobody;
    return h('div', { class: 'manipulation-head' },
      h('h3', {}, 'Drive the hand for ', this.question.state),
      h('span', { class: 'dim driver', role: 'status' },
        connected ? driver : 'No connection: the hand stands.'),
      h('span', { class: 'spacer' }), h('div', { class: 'row wrap' },
        h('button', { class: 'primary wheel', disabled: !may || !now || !connected,
          'data-deliberate': mine ? null : 'take the wheel', // to leave it is always possible
          onclick: () => this.turnWheel() }, mine ? 'Leave the wheel' : 'Take the wheel'),
        h('button', { class: 'stop', 'data-action': 'stop-hand',
          onclick: () => this.stopHand() }, '■ Stop the hand')));
  }

  /** Its arms, where the interface offers several, and the frames along whose axes it moves. */
  choicesView() {
    const { arms, state, frames } = this.manipulation || UNKNOWN;
    const arm = this.arm || (state ? state.arm : '');
    return h('div', { class: 'manipulation-choices' },
      h('div', { class: 'row wrap arms', role: 'group', 'aria-label': 'Arm',
        hidden: arms.length < 2 }, h('span', { class: 'dim' }, 'Arm'), arms.map((each) => (
        h('button', { key: each, class: 'tool', 'data-arm': each, 'aria-pressed': each === arm,
          onclick: () => this.chooseArm(each) }, each)))),
      h('div', { class: 'row wrap' },
        h('span', { class: 'dim frame-words' }, 'Along the axes of the'), frames.map((each) => (
          h('button', { key: each, class: 'tool', 'data-frame': each,
            'aria-pressed': each === this.frame, onclick: () => this.choose(each) },
          FRAMES[each])))));
  }

  /** @param {MoveKind} kind */
  padGroup(kind) {
    return h('div', { class: 'pads', role: 'group', 'aria-label': TITLES[kind] },
      MOTIONS.filter((motion) => motion.kind === kind).map(({ move }) => this.pads.get(move)));
  }

  /** @param {Move} move */
  pad(move) {
    const { key, sign } = BUTTONS[move];
    const button = h('button', { class: 'pad', 'data-move': move, title: move,
      'data-deliberate': 'hold ' + move },
      h('span', { class: 'sign' }, sign), h('span', { class: 'pad-name' }, move),
      h('kbd', {}, key));
    this.input.bind(button, move);
    return button;
  }

  /** The interface as it stands; undefined where it is gone. */
  get manipulation() { return this.app.store.get('manipulation')?.[this.question.key]; }

  /** Whether this page drives. */
  get mine() {
    const now = this.manipulation;
    return Boolean(now && this.wheel && now.wheel === this.wheel && this.app.connection.connected);
  }

  stop() {
    this.input.stop();
    clearInterval(this.timer);
    this.views.stop();
    if (!this.wheel) return;
    this.app.connection.request('leave_wheel', { question: this.question.key }).catch(() => {});
  }

  /** Take the wheel, or leave it. */
  async turnWheel() {
    const command = this.mine ? 'leave_wheel' : 'take_wheel';
    this.input.releaseAll();
    setText(this.problem, '');
    const reply = await this.app.connection.ask(command, { question: this.question.key }, '');
    this.wheel = reply.ok && reply.data ? reply.data.wheel : null;
    setText(this.problem, reply.ok ? '' : reply.message);
    this.draw();
  }

  /** Stops every driver: always possible, for everybody, and sent at once. */
  async stopHand() {
    this.input.releaseAll();
    setText(this.problem, '');
    const { key: question } = this.question;
    const { ok, message } = await this.app.connection.ask('stop_hand', { question }, CANNOT_STOP);
    if (!ok) setText(this.problem, message);
  }

  /** @param {server.DriveFrame} frame along whose axes the hand moves */
  choose(frame) {
    this.input.releaseAll();
    remember('drive frame', frame);
    this.frame = frame;
    this.draw();
  }

  /** @param {string} arm */
  chooseArm(arm) {
    this.input.releaseAll();
    this.arm = arm;
    this.draw();
  }

  showScale() {
    setText(this.scaleText, this.scale.value + ' %');
    remember('drive speed', this.scale.value);
  }

  /**
   * Not with the next beat: a key that is let go stops now.
   * @param {boolean} held
   */
  changed(held) {
    if (!held && this.wheel) this.send(NOTHING); // whoever the server takes for the driver
    if (!this.mine) return;
    if (held) this.beat();
    this.showHeld(this.input.read());
  }

  beat() {
    if (!this.mine) return;
    const wish = this.input.read();
    this.showHeld(wish);
    if (!wish.held && performance.now() - this.sentMs < IDLE_MS) return;
    const share = Number(this.scale.value) / 100;
    this.send({ held: wish.held, linear: vector((axis) => wish.linear[axis] * share),
      angular: vector((axis) => wish.angular[axis] * share), gripper: wish.gripper });
  }

  /** @param {server.DriveWish} wish */
  send(wish) {
    this.sentMs = performance.now();
    const { frame, arm, sentMs: sent } = this;
    const question = this.question.key;
    this.app.connection.send('drive', { question, frame, arm, sent, ...wish }, wish.held);
  }

  /** @param {server.DriveWish} wish */
  showHeld({ held }) {
    const { gamepad, moves } = this.input;
    setText(this.hint, HOLD + (gamepad.words || ('getGamepads' in navigator ? PAD : '')));
    for (const [move, button] of this.pads) button.classList.toggle('held', moves.has(move));
    this.root.classList.toggle('driving', held);
  }

  /** What was chosen and is not offered is not kept. */
  settle() {
    const { arms, frames } = this.manipulation || UNKNOWN;
    if (this.arm && !arms.includes(this.arm)) this.arm = '';
    if (!frames.length || frames.includes(this.frame)) return;
    this.input.releaseAll();
    this.frame = frames[0];
    this.input.unsettle(); // the person has not chosen it
  }

  draw() {
    const { mine, manipulation: now } = this;
    if (!mine) this.input.releaseAll();
    this.input.active = mine;
    this.root.classList.toggle('mine', mine);
    for (const button of this.pads.values()) button.disabled = !mine;
    this.settle();
    const { text, kind, share } = lightOf(now?.state);
    render(this.head, this.headView());
    render(this.choices, this.choicesView());
    render(this.light, h('div', { class: 'drive-light', 'data-kind': kind, '--share': share },
      text));
    redraw(this.facts, factRows(now && now.state ? factsOf(now, now.state) : []));
    this.views.draw();
  }
}
