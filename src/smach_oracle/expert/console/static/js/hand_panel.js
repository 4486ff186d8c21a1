// Driving a robot's hand: hold to move, let go to stop. The server relays what is fresh only, and the robot has a watchdog.
import { CameraView } from './camera_view.js';
import { remember, remembered } from './alerts.js';
import { h, redraw, replace, setText } from './dom.js';
import { DriveInput, KEYS, MOVES } from './drive_input.js';
import { Lost } from './link.js';

const PERIOD_MS = 25;
const IDLE_MS = 500; // how often a page that holds the wheel says so while nothing moves
const SIGNS = { forward: '↑', back: '↓', left: '←', right: '→', up: '⤒', down: '⤓', 'roll left': '↺', 'roll right': '↻', 'tilt up': '⇧', 'tilt down': '⇩', 'turn left': '⟲', 'turn right': '⟳', open: '⟷ Open', close: '⇥⇤ Close' };
const FRAMES = { tool: 'Tool', base: 'Base', camera: 'Camera' };
const TITLES = { linear: 'Move', angular: 'Turn' };

export class HandPanel {
  constructor(app, question) {
    Object.assign(this, { app, question });
    this.input = new DriveInput((held) => this.changed(held));
    this.sentMs = 0;
    this.frame = remembered('drive frame', 'tool');
    this.arm = ''; // the one that the interface has chosen, until the person chooses
    this.arms = h('div', { class: 'row wrap arms', role: 'group', 'aria-label': 'Arm' });
    this.wheelButton = h('button', { class: 'primary wheel', onclick: () => this.turn() });
    this.driver = h('span', { class: 'dim driver', role: 'status' });
    this.problem = h('p', { class: 'problem', role: 'alert' });
    this.frames = new Map(Object.entries(FRAMES).map(([name, text]) => [name, h('button', { class: 'tool', 'data-frame': name, onclick: () => this.choose(name) }, text)]));
    this.scale = h('input', { type: 'range', min: 5, max: 100, step: 5, value: remembered('drive speed', '30'), 'aria-label': 'Speed, % of the interface\'s own limit', oninput: () => this.showScale() });
    this.scaleText = h('output', { class: 'number' });
    this.pads = new Map([...MOVES.map(([name]) => name), 'open', 'close'].map((name) => [name, this.pad(name)]));
    this.light = h('div', { class: 'drive-light' });
    this.facts = h('dl', { class: 'drive-facts' });
    this.camera = h('div', { class: 'drive-camera' });
    this.hint = h('p', { class: 'dim hint' });
    this.root = this.build();
    this.showScale();
    this.choose(this.frame);
    this.showHeld(this.input.read());
    this.timer = setInterval(() => this.beat(), PERIOD_MS);
    this.update();
  }

  build() {
    const group = (kind) => h('div', { class: 'pads', role: 'group', 'aria-label': TITLES[kind] }, MOVES.filter((move) => move[1] === kind).map(([name]) => this.pads.get(name)));
    return h('section', { class: 'card hand', 'aria-label': 'Drive the hand' },
      h('div', { class: 'hand-head' }, h('h3', {}, 'Drive the hand for ', this.question.state), this.driver, h('span', { class: 'spacer' }), this.wheelButton),
      this.problem,
      h('div', { class: 'hand-body' }, h('div', { class: 'hand-see' }, this.light, this.camera, this.facts),
        h('div', { class: 'hand-controls' }, h('div', { class: 'hand-choices' }, this.arms, h('div', { class: 'row wrap' }, h('span', { class: 'dim frame-words' }, 'Along the axes of the'), [...this.frames.values()])),
          h('label', { class: 'row' }, h('span', { class: 'dim' }, 'Speed'), this.scale, this.scaleText),
          h('h4', {}, TITLES.linear), group('linear'), h('h4', {}, TITLES.angular), group('angular'),
          h('h4', {}, 'Gripper'), h('div', { class: 'pads two', role: 'group', 'aria-label': 'Gripper' }, this.pads.get('open'), this.pads.get('close')),
          this.hint)));
  }

  pad(name) {
    const key = Object.entries(KEYS).find(([, move]) => move === name)[0].replace('Key', '').replace('Arrow', '');
    const shown = { Up: '↑', Down: '↓', Left: '←', Right: '→' }[key] || key;
    const button = h('button', { class: 'pad', 'data-move': name, title: name }, h('span', { class: 'sign' }, SIGNS[name]), h('span', { class: 'pad-name' }, name), h('kbd', {}, shown));
    this.input.bind(button, name);
    return button;
  }

  get view() { return (this.app.store.get('hand') || {})[this.question.key]; }

  get mine() { return Boolean(this.view && this.wheel && this.view.wheel === this.wheel && this.app.link.connected); }

  stop() {
    this.input.stop();
    clearInterval(this.timer);
    if (this.view3) this.view3.stop();
    if (this.wheel) this.app.link.request('leave_wheel', { question: this.question.key }).catch(() => {});
  }

  async turn() {
    const name = this.mine ? 'leave_wheel' : 'take_wheel';
    this.input.releaseAll();
    setText(this.problem, '');
    try {
      const reply = await this.app.link.request(name, { question: this.question.key });
      this.wheel = reply.ok && reply.data ? reply.data.wheel : null;
      if (!reply.ok) setText(this.problem, reply.message);
    } catch (err) {
      if (!(err instanceof Lost)) throw err;
      this.wheel = null;
    }
    if (document.activeElement instanceof HTMLElement) document.activeElement.blur();
    this.update();
  }

  choose(frame) {
    this.input.releaseAll();
    this.frame = frame;
    remember('drive frame', frame);
    for (const [name, button] of this.frames) button.setAttribute('aria-pressed', name === frame);
    if (document.activeElement instanceof HTMLElement) document.activeElement.blur(); // keys drive, they press no buttons
  }

  chooseArm(arm) {
    this.input.releaseAll();
    this.arm = arm;
    if (document.activeElement instanceof HTMLElement) document.activeElement.blur();
    this.update();
  }

  // Where the interface offers several: the one that moves, and the others to change to.
  showArms(view) {
    const arms = view.arms || [];
    if (this.arm && !arms.includes(this.arm)) this.arm = '';
    const now = this.arm || (view.state ? view.state.arm : '');
    const key = JSON.stringify([arms, now]);
    if (key === this.armsKey) return;
    this.armsKey = key;
    this.arms.hidden = arms.length < 2;
    redraw(this.arms, h('span', { class: 'dim' }, 'Arm'), arms.map((arm) => h('button', { key: arm, class: 'tool', 'data-arm': arm, 'aria-pressed': String(arm === now), onclick: () => this.chooseArm(arm) }, arm)));
  }

  showScale() {
    setText(this.scaleText, this.scale.value + ' %');
    remember('drive speed', this.scale.value);
  }

  // Not with the next beat: a key that is let go stops now.
  changed(held) {
    if (!this.mine) return;
    if (held) this.beat();
    else this.send({ held: false, linear: [0, 0, 0], angular: [0, 0, 0], gripper: '' });
    this.showHeld(this.input.read());
  }

  beat() {
    if (!this.mine) return;
    const wish = this.input.read();
    this.showHeld(wish);
    if (!wish.held && performance.now() - this.sentMs < IDLE_MS) return;
    const share = Number(this.scale.value) / 100;
    this.send({ held: wish.held, linear: wish.linear.map((value) => value * share), angular: wish.angular.map((value) => value * share), gripper: wish.gripper });
  }

  send(wish) {
    this.sentMs = performance.now();
    this.app.link.tell('drive', { question: this.question.key, frame: this.frame, arm: this.arm, sent: this.sentMs, ...wish }, wish.held);
  }

  showHeld(wish) {
    setText(this.hint, 'Hold to move, let go to stop. ' + (this.input.gamepad || (navigator.getGamepads ? 'A gamepad moves while a shoulder button is held.' : '')));
    for (const [name, button] of this.pads) button.classList.toggle('held', wish.moves.has(name));
    this.root.classList.toggle('driving', wish.held);
  }

  update() {
    const view = this.view || { frames: [], driver: '' };
    const mine = this.mine;
    if (!mine) this.input.releaseAll();
    this.input.active = mine;
    const may = this.app.role === 'teleoperator';
    this.wheelButton.disabled = !may || !this.view || !this.app.link.connected;
    setText(this.wheelButton, mine ? 'Leave the wheel' : 'Take the wheel');
    setText(this.driver, !this.app.link.connected ? 'No connection: the hand stands.' : mine ? 'You drive.' : view.driver ? view.driver + ' drives.' : may ? 'Nobody drives.' : 'Nobody drives; to drive needs the role of a teleoperator.');
    this.root.classList.toggle('mine', mine);
    for (const button of this.pads.values()) button.disabled = !mine;
    for (const [name, button] of this.frames) button.hidden = !view.frames.includes(name);
    if (view.frames.length && !view.frames.includes(this.frame)) this.choose(view.frames[0]);
    this.showArms(view);
    this.showState(view.state);
    this.showCamera();
  }

  showState(state) {
    const told = !state ? '' : state.refused ? 'Refused: ' + state.refused : state.limit ? state.limit : state.moving ? 'Moves freely' : 'Stands';
    setText(this.light, told || 'Nothing is heard of the hand yet.');
    this.light.dataset.kind = !state ? '' : state.refused ? 'bad' : state.limit ? 'warn' : state.moving ? 'good' : '';
    const facts = state ? [['Speed', (state.speed === null ? '–' : Math.round(1000 * state.speed) + ' mm/s') + (state.moving && state.share !== null ? ', ' + Math.round(100 * state.share) + ' % of what is asked' : '')],
      ['Clearance', state.clearance === null ? 'nothing known is near' : (100 * state.clearance).toFixed(1) + ' cm'],
      ['Around', this.view.boxes ? this.view.boxes + (this.view.boxes === 1 ? ' box' : ' boxes') + ' in its collision map' : 'no collision map: only its own body slows the hand'],
      ['Gripper', state.gripper === null ? 'not moved yet' : (1000 * state.gripper).toFixed(0) + ' mm' + (state.stalled ? ', holds something' : '')],
      ['Tool at', (this.view.arms.length > 1 ? state.arm + ': ' : '') + state.at.map((value, axis) => 'xyz'[axis] + ' ' + (value === null ? '–' : value.toFixed(3))).join('  ')]] : [];
    const key = JSON.stringify(facts);
    if (key === this.factsKey) return;
    this.factsKey = key;
    redraw(this.facts, facts.map(([name, value]) => [h('dt', {}, name), h('dd', { class: 'number', 'data-fact': name.toLowerCase() }, value)]));
  }

  // The first colour image that there is, unless another one is chosen.
  showCamera() {
    const images = ((this.app.store.get('eye') || {}).sensors || []).filter((each) => each.kind === 'image');
    const key = images.map((each) => each.topic).join(' ');
    if (key === this.cameraKey) return;
    this.cameraKey = key;
    if (this.view3) this.view3.stop();
    this.view3 = null;
    if (!images.length) return replace(this.camera);
    const wanted = remembered('drive camera', '');
    const show = (each) => {
      if (this.view3) this.view3.stop();
      this.view3 = new CameraView(this.app, each.topic, each.type, 640);
      replace(this.camera, images.length > 1 && select, this.view3.root);
    };
    const chosen = images.find((each) => each.topic === wanted) || images.find((each) => !/depth/.test(each.topic)) || images[0];
    const select = h('select', { 'aria-label': 'Camera', onchange: () => {
      remember('drive camera', select.value);
      show(images.find((each) => each.topic === select.value));
    } }, images.map((each) => h('option', { value: each.topic, selected: each === chosen }, each.topic)));
    show(chosen);
    return null;
  }
}
