// The queue of all robots' open questions, and the one that is worked on.
import { h, redraw, replace, setText, typing } from './dom.js';
import { breakable, chip, duration, percent, rateBar } from './format.js';
import { Detail } from './question_detail.js';

export const questions = { id: 'questions', title: 'Questions', create: (app) => new Questions(app) };

class Questions {
  constructor(app) {
    this.app = app;
    this.detail = null;
    this.queue = h('div', { class: 'queue', 'aria-label': 'Open questions' });
    this.stage = h('div', { class: 'stage' });
    this.servers = h('p', { class: 'dim servers' });
    this.root = h('div', { class: 'panel questions' }, h('aside', { class: 'queue-side' }, this.queue, this.servers), this.stage);
    window.addEventListener('keydown', (event) => this.key(event));
    this.showStage();
  }

  get open() { return this.app.store.get('questions') || []; }

  badge() { return this.open.filter((each) => each.status === 'pending').length; }

  shown() { this.update(['questions', 'servers']); }

  connected() { if (this.detail) this.detail.connected(); }

  tick() {
    this.showQueue();
    if (this.detail) this.detail.tick();
  }

  update(names) {
    if (names.includes('servers')) this.showServers();
    if (names.includes('questions')) this.showQueue();
    if (this.detail) this.detail.update(names);
    else if (names.includes('questions')) this.showStage();
  }

  showServers() {
    const servers = this.app.store.get('servers') || [];
    setText(this.servers, servers.length ? 'Listening to ' + servers.map((each) => each.name + (each.connected ? '' : ' (gone)')).join(', ')
      : 'No robot with an expert query server is known yet.');
  }

  showQueue() {
    const open = this.open;
    redraw(this.queue, open.length ? open.map((question) => this.row(question)) : h('p', { class: 'empty' }, 'No open questions.'));
  }

  row(question) {
    const { key, holder } = question;
    const mine = holder && holder === this.app.expert;
    const who = question.status === 'interface' ? chip(question.interface + ' runs', 'accent', 'The interface that somebody started for it')
      : holder ? chip(mine ? 'yours' : holder, mine ? 'good' : 'warn') : chip('waiting', 'bad');
    return h('button', { key, class: 'question-row ' + question.status, 'data-key': key, 'aria-current': Boolean(this.detail && this.detail.key === key), onclick: () => this.choose(key) },
      h('span', { class: 'row' }, h('strong', { class: 'ellipsis' }, breakable(question.state, '_')), h('span', { class: 'spacer' }), who),
      h('span', { class: 'row dim' }, h('span', { class: 'where' }, question.robot + ' · ' + question.path), h('span', { class: 'spacer' }), h('span', { title: 'How often it fails, as learned' }, rateBar(question.rate, undefined, percent(question.rate) + ' fail'))),
      this.times(question));
  }

  times({ asked, deadline }) {
    const now = this.app.store.now();
    return h('span', { class: 'row' }, h('span', { class: 'dim' }, 'asked ' + duration(now - asked) + ' ago'), h('span', { class: 'spacer' }),
      deadline !== null && h('span', { class: 'left' + (deadline - now < 20 ? ' urgent' : '') }, duration(deadline - now) + ' left'));
  }

  choose(key) {
    const question = this.open.find((each) => each.key === key);
    if (!question || (this.detail && this.detail.key === key)) return;
    this.close();
    this.detail = new Detail(this.app, question, () => this.close());
    this.showStage();
    this.showQueue();
    this.detail.begin();
  }

  close() {
    if (!this.detail) return;
    this.detail.end();
    this.detail = null;
    this.showStage();
    this.showQueue();
  }

  showStage() {
    this.root.classList.toggle('working', Boolean(this.detail));
    if (this.detail) {
      replace(this.stage, this.detail.root);
      this.stage.scrollTop = 0;
      return;
    }
    const waiting = this.badge();
    const hint = waiting ? h('p', {}, 'Choose one, or press ', h('kbd', {}, 'n'), ' for the oldest that nobody works on.')
      : h('p', {}, 'Robots recover by themselves where they can; they ask here where they cannot.');
    replace(this.stage, h('div', { class: 'empty' }, h('h2', {}, waiting ? waiting + (waiting === 1 ? ' question waits' : ' questions wait') : 'All quiet'), hint));
  }

  key(event) {
    if (this.app.current !== 'questions' || event.ctrlKey || event.metaKey || event.altKey || typing(event.target) || document.querySelector('dialog[open]')) return;
    if (event.key === 'n') {
      const next = this.open.find((each) => each.status === 'pending' && !(this.detail && this.detail.key === each.key));
      if (next) this.choose(next.key);
    } else if (event.key === 'Escape') {
      this.close();
    } else if (this.detail) {
      this.detail.press(event.key);
    }
  }
}
