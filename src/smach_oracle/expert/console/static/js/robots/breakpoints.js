// @ts-check
// The states before which a machine pauses.
import { h, setText } from '../page/dom.js';
import { redraw } from '../page/redraw.js';

export class Breakpoints {
  /** @param {(pattern: string, remove: boolean) => Promise<boolean>} change */
  constructor(change) {
    this.change = change;
    this.key = '';
    this.title = h('summary', {});
    this.list = h('div', { class: 'row wrap' });
    this.field = h('input', { type: 'text', maxlength: 400, spellcheck: false,
      autocomplete: 'off', 'aria-label': 'Pause before these states',
      placeholder: 'PICK, PICK_*' });
    this.form = h('form', { class: 'row', onsubmit: (event) => this.add(event) }, this.field,
      h('button', { class: 'tool', type: 'submit' }, 'Pause there'));
    this.root = h('details', { class: 'breakpoints' }, this.title, this.list, this.form);
  }

  /**
   * @param {string[]} patterns
   * @param {boolean} may whether they may be changed
   */
  show(patterns, may) {
    const key = JSON.stringify([patterns, may]);
    if (key === this.key) return;
    this.key = key;
    setText(this.title, 'Breakpoints' + (patterns.length ? ' (' + patterns.length + ')' : ''));
    this.form.hidden = !may;
    redraw(this.list, patterns.map((pattern) => h('button', { key: pattern,
      class: 'tool', 'data-breakpoint': pattern, disabled: !may,
      'aria-label': 'Take the breakpoint ' + pattern + ' away',
      onclick: () => this.change(pattern, true) }, pattern, ' ✕')));
  }

  /** @param {Event} event */
  async add(event) {
    event.preventDefault();
    const pattern = this.field.value.trim();
    if (pattern && await this.change(pattern, false)) this.field.value = '';
  }
}
