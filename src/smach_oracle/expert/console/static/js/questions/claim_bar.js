// @ts-check
// Who works on a question, and how to take it.
import { h } from '../page/dom.js';

/**
 * @typedef {object} ClaimState
 * @property {boolean} settled this page has answered it
 * @property {server.Question | undefined} now undefined: it is open no longer
 * @property {boolean} mine
 * @property {boolean} held this page has claimed it
 * @property {boolean} claiming
 * @property {boolean} sending
 * @property {boolean} mayAnswer
 * @property {string} problem
 * @property {string} expert who uses this page
 * @property {string} gone how the robot went, and the question with it; '' where it is there
 * @property {boolean} silent somebody who must be heard for an answer is not
 */
/**
 * @typedef {object} Use
 * @property {() => void} leave
 * @property {() => void} claim
 * @property {() => void} takeOver
 */
/** @typedef {{ kind: 'good' | 'warn' | '', words: page.Child }} Bar */

const CLOSED = 'This question is closed: it was answered elsewhere, taken back, or its time was '
  + 'over. ';
const ELSEWHERE = ' (the same name, in another browser or front end)';
const RUN_OUT = 'Your claim has run out. It is made again as soon as all are heard.';
const FREE = 'Nobody works on it. Your first key or tap of an answer takes it. ';
const VIEWER = 'You are signed in as a viewer: you can watch, others answer.';

/**
 * @param {ClaimState} state
 * @param {Use} use what its buttons do
 */
export function claimBar(state, use) {
  const { problem } = state;
  const { kind, words } = barOf(state, use);
  return h('div', { key: 'claim', class: 'claim-bar ' + kind, role: 'status',
    hidden: !words && !problem }, words && h('span', {}, words),
  problem && h('span', { key: 'problem', class: 'problem', role: 'alert' }, problem));
}

/**
 * @param {ClaimState} state
 * @param {Use} use
 * @returns {Bar}
 */
function barOf({ settled, now, mine, held, claiming, sending, mayAnswer, expert, gone, silent },
  { leave, claim, takeOver }) {
  if (settled) return { kind: '', words: null };
  if (!now) return { kind: 'warn', words: [gone || CLOSED, button('Back to the list', leave)] };
  const taken = now.holder === expert && (held || claiming); // and is not told yet
  const holder = [h('strong', {}, now.holder || 'somebody'),
    now.holder === expert && !mine && ELSEWHERE];
  if (now.status === 'interface') {
    const name = h('strong', {}, now.interface);
    return { kind: '', words: ['Interface ', name, ' runs for it; ', holder, ' started it.'] };
  }
  if (!mayAnswer) {
    return { kind: '', words: [VIEWER, now.holder && [' ', holder, ' works on it.']] };
  }
  if (mine) {
    return { kind: 'good', words: sending ? 'Sending…'
      : ['It is yours. ', button('Leave it to others', leave)] };
  }
  if (now.holder && !taken) {
    const take = button('Take it over', takeOver, 'take-over');
    return { kind: 'warn', words: [holder, ' works on it. ', take] };
  }
  if (held && silent) return { kind: '', words: RUN_OUT };
  if (claiming || held) return { kind: '', words: 'Taking it…' };
  return { kind: '', words: [FREE, button('Take it', claim, 'claim')] };
}

/**
 * @param {string} text
 * @param {() => void} onclick
 * @param {string} [id]
 */
function button(text, onclick, id) {
  // what lets go, and has no id, is never pressed too soon
  return h('button', { key: text, class: 'inline', onclick, 'data-action': id,
    'data-deliberate': id }, text);
}
