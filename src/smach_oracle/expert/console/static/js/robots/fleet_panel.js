// @ts-check
// All robots on one page, those that need a person first. One, several or all are stopped, paused
// and resumed from here.
import { unlessLost } from '../page/connection.js';
import { h } from '../page/dom.js';
import { NO_EMERGENCY_STOP } from '../page/emergency.js';
import { counted } from '../page/format.js';
import { Cards, render } from '../page/redraw.js';
import { fleetCard } from './fleet_card.js';
import { byNeed, factsOf, needsHelp, resumedWords, robotsOf } from './fleet_facts.js';

/** @typedef {import('./fleet_facts.js').RobotFacts} RobotFacts */

/** @type {page.Panel} */
export const fleet = { id: 'fleet', title: 'Robots', create: (app) => new FleetPanel(app) };

const NO_ROBOTS = 'No robots yet. Every state machine that runs under the oracle, or publishes its '
  + 'structure, appears here by itself.';
const CANNOT_STOP = 'There is no connection: this page cannot stop them.';
const REPLY_LASTS_MS = 20000; // it is of the past then
const BETWEEN_MS = 200; // two drawings
const AT_REST_MS = 4000; // since a person has touched the list: only then cards change places

class FleetPanel {
  /** @param {page.App} app */
  constructor(app) {
    this.app = app;
    /** @type {Set<string>} */
    this.wanted = new Set(); // robots that a person has chosen
    /** @type {RobotFacts[]} */
    this.facts = [];
    /** @type {string[]} */
    this.order = []; // in which they are shown
    this.cards = new Cards(() => h('section', {})); // by robot
    this.reply = { ok: true, message: '' };
    this.touchedAt = this.repliedAt = -Infinity; // ms
    this.timer = 0;
    this.root = h('div', {});
  }

  /** Those that a person has chosen. */
  get chosen() { return this.facts.filter(({ robot }) => this.wanted.has(robot)); }

  /** @param {RobotFacts[]} robots */
  pausedOf(robots) { return robots.filter(({ paused }) => paused.length); }

  get sections() { return /^(?:robots|questions|health|heard|live .*)$/; }

  /** Robots of a large fleet say something all the time: they are shown a few times a second. */
  drawSoon() {
    this.timer = this.timer || setTimeout(() => {
      this.timer = 0;
      this.draw();
    }, BETWEEN_MS);
  }

  /** @param {string[]} [names] of sections that have changed */
  draw(names) {
    const { app } = this;
    if (names) {
      this.drawSoon();
      return;
    }
    this.facts = byNeed(robotsOf(app).map((robot) => factsOf(app, robot)));
    for (const { robot, holdable, standing } of this.facts) {
      if (!holdable || standing === 'gone') this.wanted.delete(robot);
    }
    this.settle(this.facts.map(({ robot }) => robot));
    render(this.root, this.view());
  }

  /**
   * The order stays while somebody is at the list: no card slips under a finger.
   * @param {string[]} names
   */
  settle(names) {
    this.cards.only(names);
    const rests = performance.now() - this.touchedAt > AT_REST_MS;
    this.order = rests ? names : [...this.order.filter((robot) => names.includes(robot)),
      ...names.filter((robot) => !this.order.includes(robot))];
  }

  view() {
    const none = !this.facts.length;
    const known = new Map(this.facts.map((facts) => [facts.robot, facts]));
    const touch = () => { this.touchedAt = performance.now(); };
    return h('div', { class: 'panel fleet' },
      h('div', { class: 'fleet-bar', hidden: none }, this.orders(),
        h('p', { class: 'fleet-summary', role: 'status' }, this.summary()), this.replyLine(),
        h('p', { class: 'dim no-emergency-stop' }, NO_EMERGENCY_STOP)),
      h('div', { class: 'fleet-list', hidden: none, onpointermove: touch, onpointerdown: touch,
        onkeydown: touch }, this.order.map((robot) => known.get(robot)).map((facts) => (
        facts && this.card(facts)))),
      h('p', { class: 'empty', hidden: !none }, NO_ROBOTS));
  }

  summary() {
    const help = this.facts.filter(needsHelp).length;
    return counted(this.facts.length, 'robot') + '. '
      + (help ? counted(help, 'needs', 'need') + ' help.' : 'None needs help.');
  }

  replyLine() {
    const { ok, message } = this.reply;
    const over = performance.now() - this.repliedAt > REPLY_LASTS_MS;
    return h('p', { class: 'fleet-reply' + (ok ? '' : ' problem'), role: 'status' },
      !over && message);
  }

  orders() {
    const { facts, chosen } = this;
    const held = facts.filter(({ holdable, standing }) => holdable && standing !== 'gone');
    const paused = this.pausedOf(chosen);
    const words = resumedWords(paused);
    const some = chosen.length + ' chosen';
    const robots = chosen.map(({ robot }) => robot);
    return h('div', { class: 'row wrap' },
      h('button', { class: 'stop', 'data-action': 'stop-all', disabled: !held.length,
        onclick: () => this.hold('stop', []) }, '■ Stop all'),
      h('button', { 'data-action': 'pause-all', disabled: !held.length,
        onclick: () => this.hold('pause', []) }, '❚❚ Pause all'),
      h('button', { class: 'stop', 'data-action': 'stop-chosen', hidden: !chosen.length,
        onclick: () => this.hold('stop', robots) }, '■ Stop ' + some),
      h('button', { 'data-action': 'pause-chosen', hidden: !chosen.length,
        onclick: () => this.hold('pause', robots) }, '❚❚ Pause ' + some),
      h('button', { class: 'go-on-button', 'data-action': 'resume-chosen', hidden: !paused.length,
        disabled: !paused.some((each) => this.mayResume(each)),
        'data-deliberate': 'resume ' + words, onclick: () => this.resume(paused) },
      h('strong', {}, 'Resume'),
      h('span', {}, ' ' + paused.length + ' chosen: ' + words + ' will run')));
  }

  /** @param {RobotFacts} facts */
  mayResume({ robot }) {
    const { app } = this;
    return app.mayAnswer && app.connection.connected && !app.liveness.whoOf(robot);
  }

  /** @param {RobotFacts} facts */
  card(facts) {
    const { robot } = facts;
    const chosen = this.wanted.has(robot);
    const mayResume = this.mayResume(facts);
    return this.cards.card(robot, [facts, chosen, mayResume], () => fleetCard(this.app, facts, {
      chosen, mayResume, choose: () => this.choose(robot),
      send: (order) => {
        if (order === 'resume') this.resume([facts]);
        else this.hold(order, [robot]);
      } }));
  }

  /** @param {string} robot that is chosen from now on, or no longer */
  choose(robot) {
    if (!this.wanted.delete(robot)) this.wanted.add(robot);
    this.draw();
  }

  /**
   * Sent at once, and not confirmed.
   * @param {'stop' | 'pause'} order
   * @param {string[]} robots none: all that can be held
   */
  async hold(order, robots) {
    this.tell({ ok: true, message: '' });
    const command = order === 'stop' ? 'stop_robots' : 'pause_robots';
    this.tell(await this.app.connection.ask(command, { robots }, CANNOT_STOP));
  }

  /**
   * One after the other: each says what runs now, and none is held up by a limit.
   * @param {RobotFacts[]} robots
   */
  async resume(robots) {
    this.tell({ ok: true, message: '' });
    const told = [];
    let ok = true;
    try {
      for (const { robot } of robots) {
        const reply = await this.app.connection.request('resume_machine', { robot, path: '' });
        told.push(robot + ': ' + reply.message);
        ok = ok && reply.ok;
      }
    } catch (err) {
      unlessLost(err);
    }
    if (told.length) this.tell({ ok, message: told.join(' ') });
  }

  /** @param {{ ok: boolean, message: string }} reply */
  tell(reply) {
    this.reply = reply;
    this.repliedAt = performance.now();
    this.draw();
  }
}
