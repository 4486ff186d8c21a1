// @ts-check
// One robot of the fleet: how it stands, at what it is, its question, its health, its last word.
import { addressOf } from '../page/address.js';
import { h, setText } from '../page/dom.js';
import { breakable, chip, duration, percent, rateBar } from '../page/format.js';
import { aged } from '../page/liveness.js';
import { redraw } from '../page/redraw.js';
import { resumedWords } from './fleet_facts.js';

/** @typedef {import('./fleet_facts.js').RobotFacts} RobotFacts */
/** @typedef {import('./fleet_facts.js').Standing} Standing */
/** @typedef {'stop' | 'pause' | 'resume'} FleetOrder */

/** @type {{ [standing in Standing]: [words: string, kind: string] }} */
const STANDINGS = { waits: ['needs an answer', 'bad'], held: ['needs a confirmation', 'bad'],
  unwell: ['not well', 'bad'], silent: ['silent', 'bad'], asked: ['asks', 'warn'],
  paused: ['paused', 'warn'], runs: ['runs', 'good'], idle: ['does not run', ''],
  gone: ['gone', ''] };

const MOST_STATES = 3; // that run beside each other

export class FleetCard {
  /**
   * @param {page.App} app
   * @param {string} robot
   * @param {(order: FleetOrder, robot: string) => void} send
   * @param {() => void} choose it was chosen, or is no longer
   */
  constructor(app, robot, send, choose) {
    this.app = app;
    this.robot = robot;
    this.name = h('a', { class: 'fleet-name' }, breakable(robot, '/'));
    this.box = h('input', { type: 'checkbox', 'aria-label': 'Choose ' + robot, onchange: choose });
    this.standing = h('span', {});
    this.facts = h('div', { class: 'fleet-facts' });
    this.stopButton = h('button', { class: 'stop', 'data-action': 'stop-robot',
      'aria-label': 'Stop ' + robot, title: 'Ask all its machines to stop: they are preempted',
      onclick: () => send('stop', robot) }, '■ Stop');
    this.pauseButton = h('button', { 'data-action': 'pause-robot', 'aria-label': 'Pause ' + robot,
      title: 'What runs goes on to its end; then its machines wait',
      onclick: () => send('pause', robot) }, '❚❚ Pause');
    this.resumeWords = h('span', {});
    this.resumeButton = h('button', { class: 'go-on-button', 'data-action': 'resume-robot',
      onclick: () => send('resume', robot) }, h('strong', {}, 'Resume'), this.resumeWords);
    this.orders = h('div', { class: 'row wrap fleet-orders' }, this.stopButton, this.pauseButton,
      this.resumeButton);
    this.root = h('section', { class: 'card fleet-card', 'data-robot': robot,
      'aria-label': robot },
    h('div', { class: 'row' }, this.box, this.name, h('span', { class: 'spacer' }), this.standing),
    this.facts, this.orders);
  }

  /**
   * @param {RobotFacts} facts
   * @param {boolean} mayResume
   */
  show(facts, mayResume) {
    const { robot, standing, path, holdable, paused } = facts;
    this.root.dataset['standing'] = standing;
    this.name.setAttribute('href', addressOf('machines', path && robot + ' ' + path));
    this.box.disabled = this.orders.hidden = !holdable || standing === 'gone';
    if (this.box.disabled) this.box.checked = false;
    redraw(this.standing, this.standingChip(facts));
    redraw(this.facts, this.lines(facts));
    const words = paused.length ? resumedWords([facts]) : '';
    this.resumeButton.hidden = !paused.length;
    this.resumeButton.disabled = !mayResume;
    this.resumeButton.dataset['deliberate'] = 'resume ' + robot + ' ' + words;
    setText(this.resumeWords, words && ': ' + words + ' will run');
  }

  /** @param {RobotFacts} facts */
  standingChip({ robot, standing, why, question }) {
    const [words, kind] = STANDINGS[standing];
    const age = standing === 'silent' ? this.app.liveness.robot(robot) : null;
    const more = age !== null ? ' for ' + aged(age)
      : standing === 'asked' ? ': ' + (question?.holder || question?.interface || '') : '';
    return chip(words + more, kind, why);
  }

  /** @param {RobotFacts} facts */
  lines(facts) {
    const { question, questions, active, health, last, standing, why } = facts;
    const now = this.app.store.now();
    const more = questions > 1 ? ', and ' + (questions - 1) + ' more' : '';
    return [
      question && h('div', { key: 'question', class: 'row fleet-question' },
        h('a', { href: addressOf('questions', question.key) },
          question.state + ' ' + question.stands + more),
        h('span', { class: 'dim' }, duration(now - question.asked) + ' ago'),
        h('span', { class: 'spacer' }), rateOf(question.rate)),
      standing === 'unwell' && h('p', { key: 'unwell', class: 'problem' }, why),
      active.slice(0, MOST_STATES).map(({ path, state, rate }) => h('p', { key: path + ' ' + state,
        class: 'row fleet-state' }, h('span', { class: 'where', title: path }, state),
      h('span', { class: 'spacer' }),
      rateOf(rate))),
      health?.battery && h('p', { key: 'battery',
        class: health.battery.low ? 'problem' : 'dim' }, batteryWords(health.battery)),
      (health?.problems || []).map(({ part, level, message }) => h('p', { key: 'problem ' + part,
        class: 'fleet-problem ' + level }, part + ': ' + (message || level))),
      last && h('p', { key: 'last', class: 'dim fleet-last' },
        last.words + ' · ' + duration(now - last.at) + ' ago'),
    ];
  }
}

/** @param {number | null} rate of a state */
function rateOf(rate) {
  return rate !== null && rateBar(rate, undefined, 'est. ' + percent(rate) + ' fail');
}

/** @param {server.Battery} battery */
function batteryWords({ share, volts, charging, low, old }) {
  const charge = share === null ? '' : percent(share);
  const parts = [charge, volts === null ? '' : volts.toFixed(1) + ' V', charging && 'charging',
    old && 'not heard lately'].filter(Boolean);
  return 'Battery ' + (low ? 'low: ' : '') + (parts.join(', ') || 'unknown');
}
