// Trials of bags: what the console has read of them, and one that is opened. A bag is known by the console's number alone.
import { h, redraw } from './dom.js';

export class Recorded {
  // `onOpen()`: what was opened is there, or cannot be had
  constructor(app, onOpen) {
    Object.assign(this, { app, onOpen });
    this.opened = null;
    this.problem = '';
    this.root = h('div', { class: 'bag-notes', hidden: true });
  }

  get section() { return this.app.store.get('bags'); }

  get trials() { return (this.section || {}).trials || []; }

  get table() { return (this.section || {}).table || []; }

  get says() { return Boolean(this.section && (this.section.note || this.section.broken.length || this.section.waiting)); }

  update() {
    const key = JSON.stringify(this.section ? [this.section.note, this.section.broken, this.section.waiting] : null);
    if (key === this.key) return;
    this.key = key;
    this.root.hidden = !this.says;
    if (!this.says) return;
    const { note, broken, waiting } = this.section;
    redraw(this.root, waiting > 0 && h('p', { class: 'dim', role: 'status' }, 'Reading bags: ' + waiting + (waiting === 1 ? ' is' : ' are') + ' still to be read.'),
      note && h('p', { class: 'dim' }, note), broken.length > 0 && h('details', { class: 'broken-bags' },
        h('summary', {}, broken.length + (broken.length === 1 ? ' bag' : ' bags') + ' could not be read'),
        h('ul', {}, broken.map((bag) => h('li', {}, h('strong', {}, bag.name), ': ', bag.reason)))));
  }

  async open(number) {
    this.problem = '';
    this.wanted = number;
    if (this.opened && this.opened.number === number) {
      this.onOpen();
      return;
    }
    try {
      const answer = await this.app.link.fetch('recorded/' + number);
      const data = answer.ok ? await answer.json() : null;
      if (this.wanted !== number) return;
      if (data) this.opened = Object.assign(data, { number });
      else this.problem = answer.status === 422 ? await answer.text() : 'The bag cannot be had (' + answer.status + ').';
    } catch (err) {
      if (this.wanted !== number) return;
      this.problem = 'The connection was lost; choose the trial again.';
    }
    this.onOpen();
  }
}
