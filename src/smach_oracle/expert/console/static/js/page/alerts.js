// What calls a person who looks elsewhere: the title, a sound, a notification.
import { h } from './dom.js';

const TITLE = 'Operator console';

function remembered(name, otherwise) {
  try { return localStorage.getItem(name) ?? otherwise; } catch (err) { return otherwise; }
}

export function remember(name, value) {
  try { localStorage.setItem(name, value); } catch (err) { /* private windows may refuse; it is a comfort only */ }
}

export { remembered };

export class Alerts {
  constructor() {
    this.sound = remembered('sound', 'on') === 'on';
    this.known = new Set();
    this.first = true;
    const wake = () => this.context();
    window.addEventListener('pointerdown', wake, { once: true });
    window.addEventListener('keydown', wake, { once: true });
  }

  context() {
    if (!this.audio && window.AudioContext) this.audio = new AudioContext();
    if (this.audio && this.audio.state === 'suspended') this.audio.resume();
    return this.audio;
  }

  // `questions`: the open list; those that nobody works on count.
  look(questions) {
    const pending = questions.filter((each) => each.status === 'pending');
    document.title = pending.length ? '(' + pending.length + ') ' + TITLE : TITLE;
    const fresh = pending.filter((each) => !this.known.has(each.key));
    this.known = new Set(questions.map((each) => each.key));
    if (fresh.length) {
      if (this.sound && !this.first) this.ring();
      this.notify(fresh[0]);
    }
    this.first = false;
  }

  ring() {
    const audio = this.audio;
    if (!audio || audio.state !== 'running') return;
    [[660, 0], [880, 0.16]].forEach(([pitch, start]) => {
      const tone = audio.createOscillator();
      const volume = audio.createGain();
      tone.frequency.value = pitch;
      volume.gain.setValueAtTime(0.0001, audio.currentTime + start);
      volume.gain.exponentialRampToValueAtTime(0.15, audio.currentTime + start + 0.02);
      volume.gain.exponentialRampToValueAtTime(0.0001, audio.currentTime + start + 0.3);
      tone.connect(volume).connect(audio.destination);
      tone.start(audio.currentTime + start);
      tone.stop(audio.currentTime + start + 0.32);
    });
  }

  notify(question) {
    if (!document.hidden || !window.Notification || Notification.permission !== 'granted') return;
    try {
      const shown = new Notification(question.state + ' failed', { body: question.robot + ' asks', tag: question.key });
      shown.onclick = () => { window.focus(); shown.close(); };
    } catch (err) { /* some phones know the class, and allow it to service workers alone */ }
  }

  // The buttons of the top bar.
  buttons() {
    const sound = h('button', { class: 'icon-button', onclick: () => {
      this.sound = !this.sound;
      remember('sound', this.sound ? 'on' : 'off');
      show();
      if (this.sound && this.context()) this.ring();
    } });
    const show = () => {
      sound.textContent = this.sound ? 'Sound on' : 'Sound off';
      sound.setAttribute('aria-pressed', this.sound);
    };
    show();
    if (!window.Notification || Notification.permission !== 'default') return [sound];
    const ask = h('button', { class: 'icon-button wide-only', onclick: async () => {
      await Notification.requestPermission();
      ask.remove();
    } }, 'Notify me');
    return [sound, ask];
  }
}
