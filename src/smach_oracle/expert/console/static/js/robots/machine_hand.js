// @ts-check
// Holding a machine: stop it, have it wait, let it go on. To stop and to pause is there for whoever
// sees the robot, and is sent at once. The two keep their places: what lets a machine go on never
// lies where they were.
import { h } from '../page/dom.js';
import { NO_EMERGENCY_STOP } from '../page/emergency.js';
import { keep, redrawWith, render } from '../page/redraw.js';
import { breakpoints } from './breakpoints.js';
import { byContainer, listed, machineOf, resumable, standingWords, waiting } from './hand_words.js';

/** @typedef {'stop_machine' | 'pause_machine'} Stop */
/** @typedef {'resume_machine' | 'step_machine' | 'confirm_state'} Start */

const CANNOT_STOP = 'There is no connection: this page cannot stop it.';
const REPLY_LASTS_MS = 20000; // it is of the past then
const NEEDS_ROLE = 'To let it go on needs the role of an operator.';
const NOTHING = { of: '', to: '', at: 0, ok: true, message: '' };

export class MachineHand {
  /**
   * @param {page.App} app
   * @param {() => machine.Place} placeNow a container of the machine
   */
  constructor(app, placeNow) {
    this.app = app;
    this.placeNow = placeNow;
    this.replied = NOTHING; // of which machine, to which command, and when (ms)
    this.goOn = h('div', { class: 'row wrap go-on' });
    this.root = h('section', { hidden: true });
  }

  get robot() { return this.placeNow().robot; }

  /**
   * How the machine stands; undefined where it cannot be held.
   * @returns {server.HeldMachine | undefined}
   */
  get machine() {
    const { robot, path } = this.placeNow();
    return machineOf(this.app.store.get(`live ${robot}`)?.control || [], path);
  }

  draw() {
    const { machine } = this;
    if (machine) {
      this.showGoOn(machine);
      render(this.root, this.view(machine));
    }
    this.root.hidden = !machine;
  }

  /** @param {server.HeldMachine} machine */
  view(machine) {
    const { path, paused } = machine;
    const { ok, message } = this.replied.of === this.which ? this.replied : NOTHING;
    const held = paused || waiting(machine).length > 0;
    return h('section', { class: 'machine-hand' + (held ? ' held' : ''),
      'aria-label': 'Stop or hold the machine' },
    h('div', { class: 'row wrap' },
      h('button', { class: 'stop', 'data-action': 'stop-machine',
        title: 'Ask the machine to stop: it is preempted',
        onclick: () => this.send('stop_machine', { path }) }, '■ Stop ' + path),
      h('button', { 'data-action': 'pause-machine',
        title: 'What runs goes on to its end; then the machine waits',
        onclick: () => this.send('pause_machine', { path }) }, '❚❚ Pause'),
      h('p', { class: 'standing', role: 'status' },
        standingWords(machine, this.robot, this.app.store))),
    keep(this.goOn),
    h('p', { class: 'problem', role: 'alert' }, !ok && message),
    h('p', { class: 'dim hand-reply', role: 'status' },
      ok && !this.replyIsOver(machine) && message),
    h('div', { class: 'row wrap hand-foot' },
      breakpoints(machine.breakpoints, this.app.mayAnswer,
        (pattern, remove) => this.send('set_breakpoint', { path, pattern, remove })),
      h('span', { class: 'dim no-emergency-stop' }, NO_EMERGENCY_STOP)));
  }

  /** The machine, among all. */
  get which() { return this.robot + ' ' + this.machine?.path; }

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
    const waits = waiting(machine);
    const asks = waits.filter(({ confirm }) => confirm);
    redrawWith(this.goOn, [robot, machine, may], () => [
      machine.paused && this.button('resume_machine', machine.path, 'Resume',
        listed(resumable(machine)), may),
      byContainer(waits).map(([path, states]) => (
        this.button('step_machine', path, 'Step', listed(states), may))),
      byContainer(asks).map(([path, states]) => (
        this.button('confirm_state', path, 'Confirm', listed(states), may))),
      (machine.paused || waits.length > 0) && !app.mayAnswer
        && h('span', { key: 'role', class: 'dim' }, NEEDS_ROLE)]);
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
      onclick: () => this.send(command, { path }) },
    h('strong', {}, word), runs && ': ' + runs + ' will run');
  }

  /**
   * Whether it was done. What a robot answers is not shown once another one is.
   * @template {Stop | Start | 'set_breakpoint'} Name
   * @param {Name} to
   * @param {Omit<server.Commands[Name], 'robot'>} args
   */
  async send(to, args) {
    this.replied = NOTHING;
    this.draw();
    const { robot, which } = this;
    const stops = to === 'stop_machine' || to === 'pause_machine';
    const { ok, message } = await this.app.connection.ask(to,
      /** @type {server.Commands[Name]} */ ({ robot, ...args }), stops ? CANNOT_STOP : '');
    if (which === this.which) {
      this.replied = { of: which, to, at: performance.now(), ok, message };
      this.draw();
    }
    return ok;
  }
}
