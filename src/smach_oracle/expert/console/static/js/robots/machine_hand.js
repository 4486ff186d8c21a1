// @ts-check
// Holding a machine: stop it, have it wait, let it go on. To stop and to pause is there for whoever
// sees the robot, and is sent at once. The two keep their places: what lets a machine go on never
// lies where they were.
import { unlessLost } from '../page/connection.js';
import { h, setText } from '../page/dom.js';
import { NO_EMERGENCY_STOP } from '../page/emergency.js';
import { redraw } from '../page/redraw.js';
import { Breakpoints } from './breakpoints.js';
import { byContainer, listed, machineOf, resumable, standingWords, waiting } from './hand_words.js';

/** @typedef {'stop_machine' | 'pause_machine'} Stop */
/** @typedef {'resume_machine' | 'step_machine' | 'confirm_state'} Start */

const CANNOT_STOP = 'There is no connection: this page cannot stop it.';
const REPLY_LASTS_MS = 20000; // it is of the past then
const NEEDS_ROLE = 'To let it go on needs the role of an operator.';

export class MachineHand {
  /** @param {page.App} app */
  constructor(app) {
    this.app = app;
    this.robot = '';
    this.path = '';
    this.key = ''; // of what may let it go on
    this.stopButton = h('button', { class: 'stop', 'data-action': 'stop-machine',
      title: 'Ask the machine to stop: it is preempted',
      onclick: () => this.send('stop_machine', this.machine?.path || '') });
    this.pauseButton = h('button', { 'data-action': 'pause-machine',
      title: 'What runs goes on to its end; then the machine waits',
      onclick: () => this.send('pause_machine', this.machine?.path || '') }, '❚❚ Pause');
    this.standing = h('p', { class: 'standing', role: 'status' });
    this.goOn = h('div', { class: 'row wrap go-on' });
    this.reply = h('p', { class: 'dim hand-reply', role: 'status' });
    this.replied = { to: '', at: 0 }; // the command, and when (ms)
    this.problem = h('p', { class: 'problem', role: 'alert' });
    this.breakpoints = new Breakpoints((pattern, remove) => this.breakAt(pattern, remove));
    this.root = h('section', { class: 'machine-hand', 'aria-label': 'Stop or hold the machine' },
      h('div', { class: 'row wrap' }, this.stopButton, this.pauseButton, this.standing),
      this.goOn, this.problem, this.reply,
      h('div', { class: 'row wrap hand-foot' }, this.breakpoints.root,
        h('span', { class: 'dim no-emergency-stop' }, NO_EMERGENCY_STOP)));
  }

  /**
   * How the machine stands; undefined where it cannot be held.
   * @returns {server.HeldMachine | undefined}
   */
  get machine() {
    return machineOf(this.app.store.get(`live ${this.robot}`)?.control || [], this.path);
  }

  /**
   * @param {string} robot
   * @param {string} path of a container
   */
  show(robot, path) {
    const before = this.machine?.path;
    const robotBefore = this.robot;
    this.robot = robot;
    this.path = path;
    if (robot !== robotBefore || before !== this.machine?.path) {
      setText(this.reply, '');
      setText(this.problem, '');
    }
    this.update();
  }

  update() {
    const { machine } = this;
    this.root.hidden = !machine;
    if (!machine) return;
    setText(this.stopButton, '■ Stop ' + machine.path);
    setText(this.standing, standingWords(machine, this.robot, this.app.store));
    if (this.replyIsOver(machine)) setText(this.reply, '');
    this.root.classList.toggle('held', machine.paused || waiting(machine).length > 0);
    this.showGoOn(machine);
    this.breakpoints.show(machine.breakpoints, this.app.mayAnswer);
  }

  /**
   * Of a pause the line above says the same as soon as the robot tells it.
   * @param {server.HeldMachine} machine
   */
  replyIsOver(machine) {
    const { to, at } = this.replied;
    return (to === 'pause_machine' && machine.paused) || performance.now() - at > REPLY_LASTS_MS;
  }

  /** @param {server.HeldMachine} machine */
  showGoOn(machine) {
    const { app, robot } = this;
    const may = app.mayAnswer && app.connection.connected && !app.liveness.whoOf(robot);
    const key = JSON.stringify([robot, machine.path, machine.paused, machine.active, may]);
    if (key === this.key) return;
    this.key = key;
    const waits = waiting(machine);
    const asks = waits.filter(({ confirm }) => confirm);
    redraw(this.goOn, machine.paused && this.button('resume_machine', machine.path, 'Resume',
      listed(resumable(machine)), may),
    byContainer(waits).map(([path, states]) => (
      this.button('step_machine', path, 'Step', listed(states), may))),
    byContainer(asks).map(([path, states]) => (
      this.button('confirm_state', path, 'Confirm', listed(states), may))),
    (machine.paused || waits.length > 0) && !app.mayAnswer
      && h('span', { key: 'role', class: 'dim' }, NEEDS_ROLE));
  }

  /**
   * @param {Start} command
   * @param {string} path
   * @param {string} word
   * @param {string} runs what will run
   * @param {boolean} may
   */
  button(command, path, word, runs, may) {
    const action = command.replace('_', '-');
    return h('button', { key: [this.robot, command, path].join(' '), class: 'go-on-button',
      'data-action': action, disabled: !may,
      'data-deliberate': [command, this.robot, path, runs].join(' '),
      onclick: () => this.send(command, path) },
    h('strong', {}, word), runs && ': ' + runs + ' will run');
  }

  /**
   * @param {Stop | Start} command
   * @param {string} path
   */
  async send(command, path) {
    setText(this.problem, '');
    setText(this.reply, '');
    const { robot } = this;
    try {
      const reply = await this.app.connection.request(command, { robot, path });
      this.tell(robot, command, reply);
    } catch (err) {
      unlessLost(err);
      if (command === 'stop_machine' || command === 'pause_machine') {
        this.tell(robot, command, { ok: false, message: CANNOT_STOP });
      }
    }
  }

  /**
   * @param {string} pattern
   * @param {boolean} remove
   */
  async breakAt(pattern, remove) {
    setText(this.problem, '');
    setText(this.reply, '');
    const { robot, machine } = this;
    try {
      const reply = await this.app.connection.request('set_breakpoint', { robot, pattern, remove,
        path: machine?.path || '' });
      this.tell(robot, 'set_breakpoint', reply);
      return reply.ok;
    } catch (err) {
      unlessLost(err);
      return false;
    }
  }

  /**
   * What a robot has answered, unless another one is shown by now.
   * @param {string} robot
   * @param {string} command
   * @param {{ ok: boolean, message: string }} reply
   */
  tell(robot, command, { ok, message }) {
    if (robot !== this.robot) return;
    this.replied = { to: command, at: performance.now() };
    setText(this.reply, ok ? message : '');
    setText(this.problem, ok ? '' : message);
    this.update();
  }
}
