// @ts-check
// The buttons of a replay.
import { h, pick } from '../page/dom.js';
import { playButton as button, playOrPause } from '../sensors/play_buttons.js';

const SPEEDS = [0.25, 1, 4, 16, 64, 256];

/**
 * @param {import('./trial_replay.js').TrialReplay} replay
 * @param {string} time
 */
export function replayControls(replay, time) {
  return h('div', { class: 'row replay-controls', role: 'group', 'aria-label': 'Replay' },
    button('|◂', 'To the beginning', 'first', () => replay.to(0)),
    button('◂', 'One event back', 'back', () => replay.step(-1)),
    playOrPause(replay.playing, () => replay.toggle()),
    button('▸', 'One event on', 'on', () => replay.step(1)),
    button('▸|', 'To the end', 'last', () => replay.to(replay.last)),
    pick({ class: 'replay-speed', 'aria-label': 'Speed' }, SPEEDS.map((each) => (
      [String(each), each + '×'])), String(replay.speed), (speed) => {
      replay.speed = Number(speed);
    }),
    button('−', 'A longer part of the time axis', 'longer', () => replay.timeline.zoom(0.5)),
    button('+', 'A shorter part of the time axis', 'shorter', () => replay.timeline.zoom(2)),
    button('↔', 'The whole time axis', 'whole', () => replay.timeline.zoom(0)),
    h('button', { class: 'tool replay-live', type: 'button', title: 'Follow what happens',
      hidden: !replay.trial.running, 'aria-pressed': replay.following, 'data-replay': 'live',
      onclick: () => replay.follow(true) }, 'Live'),
    h('span', { class: 'spacer' }), h('span', { class: 'number replay-time' }, time));
}
