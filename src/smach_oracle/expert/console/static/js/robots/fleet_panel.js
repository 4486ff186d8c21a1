// @ts-check
// All robots on one page, those that need a person first. One, several or all are stopped, paused
// and resumed from here.
import { unlessLost } from '../page/connection.js';
import { h, setText } from '../page/dom.js';
import { NO_EMERGENCY_STOP } from '../page/emergency.js';
import { counted } from '../page/format.js';
import { arrange } from '../page/redraw.js';
import { FleetCard } from './fleet_card.js';
import { byNeed, factsOf, needsHelp, resumedWords, robotsOf } from './fleet_facts.js';

/** @typedef {import('./fleet_card.js').FleetOrder} FleetOrder */
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
    /** @type {Map<string, FleetCard>} */
    this.cards = new Map();
    /** @type {RobotFacts[]} */
    this.facts = [];
    this.touchedAt = this.repliedAt = -Infinity; // ms
    this.timer = 0;
    this.summary = h('p', { class: 'fleet-summary', role: 'status' });
    this.reply = h('p', { class: 'fleet-reply', role: 'status' });
    this.stopAll = this.button('stop', 'all');
    this.pauseAll = this.button('pause', 'all');
    this.stopChosen = this.button('stop', 'chosen');
    this.pauseChosen = this.button('pause', 'chosen');
    this.resumeWords = h('span', {});
    this.resumeChosen = h('button', { class: 'go-on-button', 'data-action': 'resume-chosen',
      onclick: () => this.resume(this.pausedOf(this.chosen)) }, h('strong', {}, 'Resume'),
    this.resumeWords);
    this.list = h('div', { class: 'fleet-list' });
    for (const type of ['pointermove', 'pointerdown', 'keydown']) {
      this.list.addEventListener(type, () => { this.touchedAt = performance.now(); });
    }
    this.empty = h('p', { class: 'empty' }, NO_ROBOTS);
    this.bar = h('div', { class: 'fleet-bar' },
      h('div', { class: 'row wrap' }, this.stopAll, this.pauseAll, this.stopChosen,
        this.pauseChosen, this.resumeChosen), this.summary, this.reply,
      h('p', { class: 'dim no-emergency-stop' }, NO_EMERGENCY_STOP));
    this.root = h('div', { class: 'panel fleet' }, this.bar, this.list, this.empty);
  }

  /**
   * @param {'stop' | 'pause'} order
   * @param {'all' | 'chosen'} which
   */
  button(order, which) {
    return h('button', { class: order === 'stop' ? 'stop' : '',
      'data-action': order + '-' + which,
      onclick: () => this.hold(order, which === 'all' ? [] : this.chosen.map((f) => f.robot)) });
  }

  /** Those that a person has chosen. */
  get chosen() { return this.facts.filter(({ robot }) => this.cards.get(robot)?.box.checked); }

  /** @param {RobotFacts[]} robots */
  pausedOf(robots) { return robots.filter(({ paused }) => paused.length); }

  shown() { this.show(); }

  tick() { this.show(); }

  /** @param {string[]} names */
  update(names) {
    if (this.app.current !== 'fleet') return;
    if (names.some((name) => ['robots', 'questions', 'health', 'heard'].includes(name)
      || name.startsWith('live '))) this.showSoon();
  }

  /** Robots of a large fleet say something all the time: they are shown a few times a second. */
  showSoon() {
    this.timer = this.timer || setTimeout(() => {
      this.timer = 0;
      this.show();
    }, BETWEEN_MS);
  }

  show() {
    const { app } = this;
    this.facts = byNeed(robotsOf(app).map((robot) => factsOf(app, robot)));
    for (const facts of this.facts) this.cardOf(facts.robot).show(facts, this.mayResume(facts));
    this.showList();
    this.showBar();
  }

  /** The order stays while somebody is at the list: no card slips under a finger. */
  showList() {
    const names = this.facts.map(({ robot }) => robot);
    for (const robot of [...this.cards.keys()]) {
      if (!names.includes(robot)) this.cards.delete(robot);
    }
    const shown = [...this.list.children].flatMap((each) => (
      each instanceof HTMLElement ? [each.dataset['robot'] || ''] : []));
    const rests = performance.now() - this.touchedAt > AT_REST_MS;
    const order = rests ? names : [...shown.filter((robot) => names.includes(robot)),
      ...names.filter((robot) => !shown.includes(robot))];
    if (order.join('\n') !== shown.join('\n')) {
      arrange(this.list, order.map((robot) => this.cardOf(robot).root));
    }
    this.empty.hidden = names.length > 0;
    this.bar.hidden = this.list.hidden = !names.length;
  }

  showBar() {
    const { facts, chosen } = this;
    const held = facts.filter(({ holdable, standing }) => holdable && standing !== 'gone');
    const help = facts.filter(needsHelp);
    setText(this.summary, counted(facts.length, 'robot') + '. '
      + (help.length ? counted(help.length, 'needs', 'need') + ' help.' : 'None needs help.'));
    if (performance.now() - this.repliedAt > REPLY_LASTS_MS) setText(this.reply, '');
    setText(this.stopAll, '■ Stop all');
    setText(this.pauseAll, '❚❚ Pause all');
    this.stopAll.disabled = this.pauseAll.disabled = !held.length;
    this.stopChosen.hidden = this.pauseChosen.hidden = !chosen.length;
    setText(this.stopChosen, '■ Stop ' + chosen.length + ' chosen');
    setText(this.pauseChosen, '❚❚ Pause ' + chosen.length + ' chosen');
    const paused = this.pausedOf(chosen);
    const words = resumedWords(paused);
    this.resumeChosen.hidden = !paused.length;
    this.resumeChosen.disabled = !paused.some((each) => this.mayResume(each));
    this.resumeChosen.dataset['deliberate'] = 'resume ' + words;
    setText(this.resumeWords, ' ' + paused.length + ' chosen: ' + words + ' will run');
  }

  /** @param {RobotFacts} facts */
  mayResume({ robot }) {
    const { app } = this;
    return app.mayAnswer && app.connection.connected && !app.liveness.whoOf(robot);
  }

  /** @param {string} robot */
  cardOf(robot) {
    const known = this.cards.get(robot);
    if (known) return known;
    const card = new FleetCard(this.app, robot, (order, name) => this.send(order, name),
      () => this.showBar());
    this.cards.set(robot, card);
    return card;
  }

  /**
   * @param {FleetOrder} order
   * @param {string} robot
   */
  send(order, robot) {
    if (order === 'resume') this.resume(this.facts.filter((each) => each.robot === robot));
    else this.hold(order, [robot]);
  }

  /**
   * Sent at once, and not confirmed.
   * @param {'stop' | 'pause'} order
   * @param {string[]} robots none: all that can be held
   */
  async hold(order, robots) {
    setText(this.reply, '');
    try {
      const command = order === 'stop' ? 'stop_robots' : 'pause_robots';
      this.tell(await this.app.connection.request(command, { robots }));
    } catch (err) {
      unlessLost(err);
      this.tell({ ok: false, message: CANNOT_STOP });
    }
  }

  /**
   * One after the other: each says what runs now, and none is held up by a limit.
   * @param {RobotFacts[]} robots
   */
  async resume(robots) {
    setText(this.reply, '');
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
  tell({ ok, message }) {
    this.reply.classList.toggle('problem', !ok);
    setText(this.reply, message);
    this.repliedAt = performance.now();
  }
}
