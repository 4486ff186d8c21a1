// @ts-check
// One robot of the fleet: how it stands, at what it is, its question, its health, its last word.
import { addressOf } from '../page/address.js';
import { h } from '../page/dom.js';
import { breakable, chip, percent, rateBar, since } from '../page/format.js';
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

/**
 * @typedef {object} CardUse
 * @property {boolean} chosen
 * @property {boolean} mayResume
 * @property {(order: FleetOrder) => void} send
 * @property {() => void} choose it is chosen, or is no longer
 */

/**
 * @param {page.App} app
 * @param {RobotFacts} facts
 * @param {CardUse} use
 */
export function fleetCard(app, facts, { chosen, mayResume, send, choose }) {
  const { robot, standing, path, holdable, paused } = facts;
  const fixed = !holdable || standing === 'gone';
  const words = paused.length ? resumedWords([facts]) : '';
  return h('section', { class: 'card fleet-card', 'data-robot': robot,
    'data-standing': standing, 'aria-label': robot },
  h('div', { class: 'row' },
    h('input', { type: 'checkbox', 'aria-label': 'Choose ' + robot, checked: chosen,
      disabled: fixed, onchange: choose }),
    h('a', { class: 'fleet-name', href: addressOf('machines', path && robot + ' ' + path) },
      breakable(robot, '/')),
    h('span', { class: 'spacer' }), h('span', {}, standingChip(app, facts))),
  h('div', { class: 'fleet-facts' }, linesOf(app, facts)),
  h('div', { class: 'row wrap fleet-orders', hidden: fixed },
    h('button', { class: 'stop', 'data-action': 'stop-robot', 'aria-label': 'Stop ' + robot,
      title: 'Ask all its machines to stop: they are preempted',
      onclick: () => send('stop') }, '■ Stop'),
    h('button', { 'data-action': 'pause-robot', 'aria-label': 'Pause ' + robot,
      title: 'What runs goes on to its end; then its machines wait',
      onclick: () => send('pause') }, '❚❚ Pause'),
    h('button', { class: 'go-on-button', 'data-action': 'resume-robot', hidden: !paused.length,
      disabled: !mayResume, 'data-deliberate': 'resume ' + robot + ' ' + words,
      onclick: () => send('resume') },
    h('strong', {}, 'Resume'), h('span', {}, words && ': ' + words + ' will run'))));
}

/**
 * @param {page.App} app
 * @param {RobotFacts} facts
 */
function standingChip(app, { robot, standing, why, question }) {
  const [words, kind] = STANDINGS[standing];
  const age = standing === 'silent' ? app.liveness.robot(robot) : null;
  const more = age !== null ? [' for ', since(app.store.now() - age, app.store.now())]
    : standing === 'asked' ? ': ' + (question?.holder || question?.interface || '') : '';
  return chip([words, more], kind, why);
}

/**
 * @param {page.App} app
 * @param {RobotFacts} facts
 * @returns {page.Child}
 */
function linesOf(app, { question, questions, active, health, last, standing, why }) {
  const now = app.store.now();
  const more = questions > 1 ? ', and ' + (questions - 1) + ' more' : '';
  return [
    question && h('div', { key: 'question', class: 'row fleet-question' },
      h('a', { href: addressOf('questions', question.key) },
        question.state + ' ' + question.stands + more),
      h('span', { class: 'dim' }, since(question.asked, now), ' ago'),
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
      last.words, ' · ', since(last.at, now), ' ago'),
  ];
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
