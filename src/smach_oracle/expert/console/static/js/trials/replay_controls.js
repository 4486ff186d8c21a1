// @ts-check
// The buttons of a replay.
import { h, setText } from '../page/dom.js';
import { playButton as button, showPlaying } from '../sensors/play_buttons.js';

const SPEEDS = [0.25, 1, 4, 16, 64, 256];

/**
 * @typedef {object} Use
 * @property {() => void} first
 * @property {() => void} back
 * @property {() => void} play
 * @property {() => void} forward
 * @property {() => void} last
 * @property {() => void} follow
 * @property {(factor: number) => void} zoom the time axis; 0: the whole trial
 */

export class ReplayControls {
  /** @param {Use} use what each button does */
  constructor(use) {
    this.playButton = button('▶', 'Play', 'play', use.play);
    this.speedChoice = h('select', { class: 'replay-speed', 'aria-label': 'Speed' },
      SPEEDS.map((each) => h('option', { value: each, selected: each === 1 }, each + '×')));
    this.liveButton = h('button', { class: 'tool replay-live', type: 'button',
      title: 'Follow what happens', onclick: use.follow, 'data-replay': 'live' }, 'Live');
    this.time = h('span', { class: 'number replay-time' });
    this.root = h('div', { class: 'row replay-controls', role: 'group', 'aria-label': 'Replay' },
      button('|◂', 'To the beginning', 'first', use.first),
      button('◂', 'One event back', 'back', use.back), this.playButton,
      button('▸', 'One event on', 'on', use.forward), button('▸|', 'To the end', 'last', use.last),
      this.speedChoice,
      button('−', 'A longer part of the time axis', 'longer', () => use.zoom(0.5)),
      button('+', 'A shorter part of the time axis', 'shorter', () => use.zoom(2)),
      button('↔', 'The whole time axis', 'whole', () => use.zoom(0)), this.liveButton,
      h('span', { class: 'spacer' }), this.time);
  }

  get speed() { return Number(this.speedChoice.value); }

  /** @param {boolean} playing */
  showPlaying(playing) { showPlaying(this.playButton, playing); }

  /** @param {boolean} on */
  showFollowing(on) { this.liveButton.setAttribute('aria-pressed', String(on)); }

  /** @param {boolean} running whether there is something to follow */
  showRunning(running) { this.liveButton.hidden = !running; }

  /** @param {string} text */
  showTime(text) { setText(this.time, text); }
}
