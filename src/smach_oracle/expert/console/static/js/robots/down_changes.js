// @ts-check
// What may be changed in the store of a machine that is down, before it goes on.
import { h, pick, toast } from '../page/dom.js';
import { render } from '../page/redraw.js';

const NEEDS_ROLE = 'To change it needs the role of an operator.';
const TO_DROP = 'Drop the trial? It is never resumed. When its program is started again, it begins '
  + 'at the start.';
const NOTHING = { ok: true, message: '' };

export class DownChanges {
  /**
   * @param {page.App} app
   * @param {server.DownMachine} row
   */
  constructor(app, row) {
    this.app = app;
    this.row = row;
    this.label = ''; // of the state that is chosen, to go on there
    /** @type {{ down: string, moment: number } | null} */
    this.asked = null; // what may be dropped, as it was when it was asked for
    this.replied = NOTHING;
    this.root = h('section', {});
  }

  get may() { return this.app.mayAnswer && this.app.connection.connected; }

  /**
   * What it is for a row as it is now.
   * @param {server.DownMachine} row
   */
  show(row) {
    this.row = row;
    if (!row.states.includes(this.label)) this.label = row.states[0] || '';
    if (this.asked && !this.may) this.keep();
    else this.draw();
    return this.root;
  }

  draw() { render(this.root, this.view()); }

  view() {
    const { row: { key, moment, states, userdata }, label, asked, may } = this;
    const { ok, message } = this.replied;
    const at = key + ' ' + moment;
    return h('section', { class: 'down-changes', 'aria-label': 'Change it' },
      h('form', { class: 'row wrap', onsubmit: (event) => this.goTo(event) },
        h('span', {}, 'Go on at'),
        pick({ 'aria-label': 'State at which it goes on' }, states.map((each) => [each, each]),
          label, (chosen) => {
            this.label = chosen;
            this.draw();
          }),
        this.button('goto-stored', 'Go on there', may && states.length > 0,
          { 'data-deliberate': 'goto_stored ' + at + ' ' + label })),
      h('form', { class: 'row wrap', onsubmit: (event) => this.edit(event) },
        h('span', {}, 'Give'), h('select', { 'aria-label': 'Userdata key' }, userdata.map(
          ([path, item]) => h('option', { key: path + ' ' + item,
            value: JSON.stringify([path, item]) }, path + ' ' + item))),
        h('span', {}, 'the value'), h('input', { type: 'text', maxlength: 40000,
          spellcheck: false, autocomplete: 'off', 'aria-label': 'New value, as JSON',
          placeholder: '3, "cup", [1, 2]' }),
        this.button('edit-stored', 'Change', may && userdata.length > 0,
          { 'data-deliberate': 'edit_stored ' + at })),
      h('div', { class: 'row wrap' }, this.button('drop-stored', 'Drop the trial', may,
        { type: 'button', hidden: Boolean(asked), onclick: () => this.ask() })),
      asked && h('div', { class: 'drop-asking', role: 'group', 'aria-label': 'Drop the trial' },
        h('p', {}, TO_DROP), h('div', { class: 'row wrap' },
          h('button', { class: 'danger', 'data-action': 'confirm-drop-stored',
            'data-deliberate': 'confirm dropping ' + asked.down,
            onclick: () => this.drop(asked) }, 'Yes, drop it'),
          h('button', { 'data-action': 'keep-stored', onclick: () => this.keep() },
            'No, go back'))),
      h('p', { key: 'role', class: 'dim needs-role' }, !this.app.mayAnswer && NEEDS_ROLE),
      h('p', { key: 'problem', class: 'problem', role: 'alert' }, !ok && message),
      h('p', { key: 'reply', class: 'dim', role: 'status' }, ok && message));
  }

  /**
   * @param {string} action
   * @param {string} words
   * @param {boolean} may
   * @param {page.Properties} properties
   */
  button(action, words, may, properties) {
    return h('button', { type: 'submit', 'data-action': action, disabled: !may,
      title: this.app.mayAnswer ? null : NEEDS_ROLE, ...properties }, words);
  }

  /** @param {string} action whose button gets the focus */
  focus(action) {
    const button = this.root.querySelector('[data-action=' + action + ']');
    if (button instanceof HTMLElement) button.focus();
  }

  /** @param {Event} event */
  goTo(event) {
    event.preventDefault();
    this.send('goto_stored', { ...this.which, label: this.label });
  }

  /** @param {SubmitEvent} event */
  async edit(event) {
    event.preventDefault();
    const form = event.target instanceof Element ? event.target : this.root;
    const [item, field] = [form.querySelector('select'), form.querySelector('input')];
    if (!item || !field) return;
    const [container, key] = JSON.parse(item.value);
    const args = { ...this.which, container, key, json: field.value };
    if (await this.send('edit_stored', args)) field.value = '';
  }

  /** It is never resumed then: it is asked for, and confirmed. */
  ask() {
    this.asked = this.which;
    this.draw();
    this.focus('keep-stored');
  }

  keep() {
    const free = this.root.querySelector('.drop-asking')?.contains(document.activeElement);
    this.asked = null;
    this.draw();
    if (free) this.focus('drop-stored');
  }

  /** @param {{ down: string, moment: number }} which */
  drop(which) {
    this.keep();
    this.send('drop_stored', which);
  }

  get which() { return { down: this.row.key, moment: this.row.moment }; }

  /**
   * Whether it was done.
   * @template {'goto_stored' | 'edit_stored' | 'drop_stored'} Name
   * @param {Name} name
   * @param {server.Commands[Name]} args
   */
  async send(name, args) {
    this.replied = NOTHING;
    this.draw();
    this.replied = await this.app.connection.ask(name, args, '');
    const { ok, message } = this.replied;
    if (ok && name === 'drop_stored') toast(message, 'good'); // its row goes
    this.draw();
    return ok;
  }
}
