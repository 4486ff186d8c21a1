// @ts-check
// What calls a person who looks elsewhere, or does not see: the title, a sound, a notification, a
// live region.
import { announce } from './announce.js';
import { h } from './dom.js';
import { counted } from './format.js';
import { remember, remembered } from './preferences.js';

/** @typedef {import('../server').Question} Question */

const TITLE = 'Operator console';
const TONES = [{ pitch: 660, start: 0 }, { pitch: 880, start: 0.16 }]; // Hz, s
const CAN_NOTIFY = 'Notification' in window;

export class Alerts {
  constructor() {
    this.sound = remembered('sound', 'on') === 'on';
    /** @type {Set<string>} */
    this.known = new Set();
    this.first = true;
    /** @type {AudioContext | null} */
    this.audio = null;
    const wake = () => this.wakeAudio();
    window.addEventListener('pointerdown', wake, { once: true });
    window.addEventListener('keydown', wake, { once: true });
  }

  /** Browsers allow sound only once somebody has pressed something. */
  wakeAudio() {
    if (!this.audio && 'AudioContext' in window) this.audio = new AudioContext();
    if (this.audio && this.audio.state === 'suspended') this.audio.resume();
    return this.audio;
  }

  /**
   * Call for those that nobody works on.
   * @param {Question[]} questions that are open
   */
  look(questions) {
    const pending = questions.filter((each) => each.status === 'pending');
    document.title = pending.length ? '(' + pending.length + ') ' + TITLE : TITLE;
    const fresh = pending.filter((each) => !this.known.has(each.key));
    this.known = new Set(questions.map((each) => each.key));
    if (fresh.length) {
      if (this.sound && !this.first) this.ring();
      this.notify(fresh[0]);
      announce(newsOf(fresh, pending.length));
    }
    this.first = false;
  }

  ring() {
    const { audio } = this;
    if (!audio || audio.state !== 'running') return;
    for (const { pitch, start } of TONES) {
      const begin = audio.currentTime + start;
      const tone = audio.createOscillator();
      const volume = audio.createGain();
      tone.frequency.value = pitch;
      volume.gain.setValueAtTime(0.0001, begin);
      volume.gain.exponentialRampToValueAtTime(0.15, begin + 0.02);
      volume.gain.exponentialRampToValueAtTime(0.0001, begin + 0.3);
      tone.connect(volume).connect(audio.destination);
      tone.start(begin);
      tone.stop(begin + 0.32);
    }
  }

  /** @param {Question} question */
  notify({ state, stands, robot, key }) {
    if (!document.hidden || !CAN_NOTIFY || Notification.permission !== 'granted') return;
    try {
      const shown = new Notification(state + ' ' + stands, { body: robot + ' asks', tag: key });
      shown.onclick = () => { window.focus(); shown.close(); };
    } catch (err) { /* some phones know the class, and allow it to service workers alone */ }
  }

  /** The buttons of the top bar. */
  buttons() {
    /** @type {HTMLButtonElement} */
    const sound = h('button', { class: 'icon-button', onclick: () => this.toggleSound(sound) });
    this.showSound(sound);
    if (!CAN_NOTIFY || Notification.permission !== 'default') return [sound];
    /** @type {HTMLButtonElement} */
    const ask = h('button', { class: 'icon-button wide-only', onclick: async () => {
      await Notification.requestPermission();
      ask.remove();
    } }, 'Notify me');
    return [sound, ask];
  }

  /** @param {HTMLButtonElement} button */
  toggleSound(button) {
    this.sound = !this.sound;
    remember('sound', this.sound ? 'on' : 'off');
    this.showSound(button);
    if (this.sound && this.wakeAudio()) this.ring();
  }

  /** @param {HTMLButtonElement} button */
  showSound(button) {
    button.textContent = this.sound ? 'Sound on' : 'Sound off';
    button.setAttribute('aria-pressed', String(this.sound));
  }
}

/**
 * @param {Question[]} fresh
 * @param {number} waiting how many wait in all
 */
function newsOf(fresh, waiting) {
  const { state, stands, robot } = fresh[0];
  const others = fresh.length > 1 ? ', and ' + counted(fresh.length - 1, 'other') : '';
  return 'New question: ' + state + ' ' + stands + ', ' + robot + others + '. '
    + counted(waiting, 'question waits', 'questions wait') + '.';
}
