// @ts-check
// Finds states by a part of their names.
import { h, setText } from '../page/dom.js';
import { counted } from '../page/format.js';

const FROM = 12; // states: fewer are seen at a glance

export class StateSearch {
  /**
   * @param {() => void} onChange the text is another one
   * @param {(label: string) => void} onFound a state to look at
   */
  constructor(onChange, onFound) {
    this.onFound = onFound;
    this.input = h('input', { type: 'search', placeholder: 'Find a state',
      'aria-label': 'Find a state by a part of its name', oninput: () => {
        this.at = 0;
        onChange();
        this.look();
      }, onkeydown: (event) => {
        if (event.key !== 'Enter') return;
        event.preventDefault();
        this.at += 1;
        this.look();
      } });
    this.count = h('span', { class: 'dim', role: 'status' });
    this.root = h('label', { class: 'row state-search' }, this.input, this.count);
    /** @type {string[]} */
    this.labels = [];
    this.at = 0;
  }

  /** @param {server.Graph} graph */
  set({ states }) {
    this.labels = states.map(({ label }) => label);
    this.root.hidden = this.labels.length < FROM;
    const all = counted(this.labels.length, 'state');
    setText(this.count, this.text ? this.found.length + ' of ' + all : '');
  }

  get text() { return this.root.hidden ? '' : this.input.value.trim().toLowerCase(); }

  get found() { return this.labels.filter((label) => this.has(label)); }

  /**
   * Whether the name of a state has the text in it.
   * @param {string} label
   */
  has(label) { return label.toLowerCase().includes(this.text); }

  look() {
    const { found } = this;
    if (this.text && found.length) this.onFound(found[this.at % found.length]);
  }
}
