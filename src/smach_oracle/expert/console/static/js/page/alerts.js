// @ts-check
// What calls a person who looks elsewhere, or does not see: the title, a sound, a notification, a
// live region.
import { announce, h, setText } from './dom.js';
import { counted } from './format.js';
import { remember, remembered } from './preferences.js';

/** @typedef {'on' | 'off' | 'asks' | 'none'} SoundState `asks`: the browser waits for a press */

const TITLE = 'Operator console';
const TONES = [{ pitch: 660, start: 0 }, { pitch: 880, start: 0.16 }]; // Hz, s
const CAN_NOTIFY = 'Notification' in window;
const CAN_SOUND = 'AudioContext' in window;

const PRESSES = ['pointerdown', 'pointerup', 'keydown']; // of a finger the second one allows sound
const NEAR_S = 60; // before the deadline
/** @type {{ [state in SoundState]: string }} */
const SOUNDS = { on: 'Sound on', off: 'Sound off', asks: 'Allow sound', none: 'No sound here' };

/**
 * Whether a question waits for somebody: nobody works on it, or its holder presses nothing.
 * @param {server.Question} question
 */
export function waits({ status, idle }) {
  return status === 'pending' || (status === 'claimed' && idle > 0);
}

/**
 * Why a question calls people now, each reason with what makes it another one.
 * @param {server.Question} question
 * @param {number} now by the server's clock
 * @returns {{ kind: 'new' | 'idle' | 'near', id: string }[]}
 */
function reasonsOf({ key, status, idle, deadline }, now) {
  const claimed = status === 'claimed';
  const near = status !== 'interface' && deadline !== null && deadline - now <= NEAR_S;
  /** @type {{ kind: 'new' | 'idle' | 'near', id: string }[]} */
  const reasons = [];
  if (status === 'pending') reasons.push({ kind: 'new', id: key });
  if (claimed && idle > 0) reasons.push({ kind: 'idle', id: key + ' idle ' + idle });
  if (near) reasons.push({ kind: 'near', id: key + ' near' });
  return reasons;
}

export class Alerts {
  constructor() {
    this.sound = remembered('sound', 'on') === 'on';
    /** @type {Set<string>} */
    this.known = new Set(); // reasons
    this.first = true;
    /** @type {AudioContext | null} */
    this.audio = null;
    /** @type {HTMLButtonElement} */
    this.button = h('button', { class: 'icon-button', id: 'sound',
      onpointerdown: () => { this.pressedAs = this.soundState; },
      onkeydown: () => { this.pressedAs = this.soundState; },
      onclick: () => this.press() });
    /** @type {SoundState} */
    this.pressedAs = 'off';
    this.showSound();
    for (const kind of PRESSES) window.addEventListener(kind, () => this.wakeAudio());
  }

  /** Browsers allow sound only once somebody has pressed something. */
  wakeAudio() {
    if (navigator.userActivation?.hasBeenActive === false) return this.audio;
    if (!this.audio && CAN_SOUND) {
      this.audio = new AudioContext();
      this.audio.onstatechange = () => this.showSound();
    }
    if (this.audio && this.audio.state === 'suspended') this.audio.resume().catch(() => {});
    this.showSound();
    return this.audio;
  }

  /**
   * Call for those that nobody works on, whose holder presses nothing, or whose time is short.
   * @param {server.Question[]} questions that are open
   * @param {number} now by the server's clock
   */
  look(questions, now) {
    const waiting = questions.filter(waits).length;
    const title = waiting ? '(' + waiting + ') ' + TITLE : TITLE;
    if (document.title !== title) document.title = title;
    const calls = questions.map((question) => ({ question,
      fresh: reasonsOf(question, now).filter(({ id }) => !this.known.has(id)) }));
    const fresh = calls.filter((each) => each.fresh.length);
    // one that was claimed, and is released, calls nobody again
    this.known = new Set(questions.flatMap((question) => [question.key,
      ...reasonsOf(question, now).map(({ id }) => id)]));
    if (fresh.length) {
      if (this.sound && !this.first) this.ring();
      this.notify(fresh[0].question);
      announce(newsOf(fresh[0].question, fresh[0].fresh[0].kind, fresh.length, waiting));
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

  /** @param {server.Question} question */
  notify({ state, stands, robot, key }) {
    if (!document.hidden || !CAN_NOTIFY || Notification.permission !== 'granted') return;
    try {
      const shown = new Notification(state + ' ' + stands, { body: robot + ' asks', tag: key });
      shown.onclick = () => { window.focus(); shown.close(); };
    } catch (err) { /* some phones know the class, and allow it to service workers alone */ }
  }

  /** The buttons of the top bar. */
  buttons() {
    if (!CAN_NOTIFY || Notification.permission !== 'default') return [this.button];
    /** @type {HTMLButtonElement} */
    const ask = h('button', { class: 'icon-button wide-only', onclick: async () => {
      await Notification.requestPermission();
      ask.remove();
    } }, 'Notify me');
    return [this.button, ask];
  }

  /**
   * Whether a sound would be heard: it is on only where the browser plays it.
   * @returns {SoundState}
   */
  get soundState() {
    if (!CAN_SOUND) return 'none';
    if (!this.sound) return 'off';
    return this.audio?.state === 'running' ? 'on' : 'asks';
  }

  /** Turn it on or off. A press that has only allowed it turns nothing off. */
  press() {
    if (this.pressedAs !== 'asks') {
      this.sound = !this.sound;
      remember('sound', this.sound ? 'on' : 'off');
    }
    this.wakeAudio();
    if (this.sound) this.ring();
  }

  showSound() {
    const state = this.soundState;
    setText(this.button, SOUNDS[state]);
    this.button.disabled = state === 'none';
    this.button.setAttribute('aria-pressed', String(state === 'on'));
  }
}

/**
 * @param {server.Question} question the first of those that call
 * @param {'new' | 'idle' | 'near'} kind why it does
 * @param {number} count how many call
 * @param {number} waiting how many wait in all
 */
function newsOf({ state, stands, robot, holder }, kind, count, waiting) {
  const words = { new: 'New question', near: 'Little time is left',
    idle: holder + ' has a question, and presses nothing' };
  const others = count > 1 ? ', and ' + counted(count - 1, 'other') : '';
  return words[kind] + ': ' + state + ' ' + stands + ', ' + robot + others + '. '
    + counted(waiting, 'question waits', 'questions wait') + '.';
}
