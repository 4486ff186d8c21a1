// @ts-check
// What may be changed in the store of a machine that is down, before it goes on.
import { h, replace, setText, toast } from '../page/dom.js';
import { redraw } from '../page/redraw.js';

/** @typedef {'goto_stored' | 'edit_stored' | 'drop_stored'} Change */

const NEEDS_ROLE = 'To change it needs the role of an operator.';
const TO_DROP = 'Drop the trial? It is never resumed. When its program is started again, it begins '
  + 'at the start.';

export class DownChanges {
  /**
   * @param {page.App} app
   * @param {server.DownMachine} row
   */
  constructor(app, row) {
    this.app = app;
    this.row = row;
    this.state = h('select', { 'aria-label': 'State at which it goes on',
      onchange: () => this.showMeaning() });
    this.going = h('button', { type: 'submit', 'data-action': 'goto-stored' }, 'Go on there');
    this.item = h('select', { 'aria-label': 'Userdata key' });
    this.json = h('input', { type: 'text', maxlength: 40000, spellcheck: false,
      autocomplete: 'off', 'aria-label': 'New value, as JSON', placeholder: '3, "cup", [1, 2]' });
    this.editing = h('button', { type: 'submit', 'data-action': 'edit-stored' }, 'Change');
    this.dropping = h('button', { 'data-action': 'drop-stored', onclick: () => this.ask() },
      'Drop the trial');
    this.asking = h('div', { class: 'drop-asking', role: 'group', 'aria-label': 'Drop the trial',
      hidden: true });
    this.why = h('p', { class: 'dim needs-role' });
    this.reply = h('p', { class: 'dim', role: 'status' });
    this.problem = h('p', { class: 'problem', role: 'alert' });
    this.root = h('section', { class: 'down-changes', 'aria-label': 'Change it' },
      h('form', { class: 'row wrap', onsubmit: (event) => this.goTo(event) },
        h('span', {}, 'Go on at'), this.state, this.going),
      h('form', { class: 'row wrap', onsubmit: (event) => this.edit(event) },
        h('span', {}, 'Give'), this.item, h('span', {}, 'the value'), this.json, this.editing),
      h('div', { class: 'row wrap' }, this.dropping), this.asking, this.why, this.problem,
      this.reply);
  }

  /**
   * What it is for a row as it is now.
   * @param {server.DownMachine} row
   */
  show(row) {
    this.row = row;
    redraw(this.state, row.states.map((value) => h('option', { key: value, value }, value)));
    redraw(this.item, row.userdata.map(([path, key]) => {
      const value = JSON.stringify([path, key]);
      return h('option', { key: value, value }, path + ' ' + key);
    }));
    const { mayAnswer, connection } = this.app;
    const may = mayAnswer && connection.connected;
    this.going.disabled = !may || !row.states.length;
    this.editing.disabled = !may || !row.userdata.length;
    this.dropping.disabled = !may;
    if (!may) this.keep();
    for (const button of [this.going, this.editing, this.dropping]) {
      button.title = mayAnswer ? '' : NEEDS_ROLE;
    }
    setText(this.why, mayAnswer ? '' : NEEDS_ROLE);
    this.showMeaning();
    return this.root;
  }

  showMeaning() {
    const { key, moment } = this.row;
    const at = [key, moment].join(' ');
    this.going.dataset['deliberate'] = 'goto_stored ' + at + ' ' + this.state.value;
    this.editing.dataset['deliberate'] = 'edit_stored ' + at;
  }

  /** @param {Event} event */
  goTo(event) {
    event.preventDefault();
    this.send('goto_stored', { ...this.which, label: this.state.value });
  }

  /** @param {Event} event */
  async edit(event) {
    event.preventDefault();
    const [container, key] = JSON.parse(this.item.value);
    const json = this.json.value;
    if (await this.send('edit_stored', { ...this.which, container, key, json })) {
      this.json.value = '';
    }
  }

  /** It is never resumed then: it is asked for, and confirmed. */
  ask() {
    const { which } = this;
    const back = h('button', { 'data-action': 'keep-stored', onclick: () => this.keep() },
      'No, go back');
    replace(this.asking, h('p', {}, TO_DROP), h('div', { class: 'row wrap' },
      h('button', { class: 'danger', 'data-action': 'confirm-drop-stored',
        'data-deliberate': 'confirm dropping ' + which.down, onclick: () => this.drop(which) },
      'Yes, drop it'), back));
    this.turn(true);
    back.focus();
  }

  keep() {
    const free = this.asking.contains(document.activeElement);
    this.turn(false);
    if (free) this.dropping.focus();
  }

  /** @param {boolean} asking */
  turn(asking) {
    this.asking.hidden = !asking;
    this.dropping.hidden = asking;
  }

  /** @param {{ down: string, moment: number }} which as it was when it was asked for */
  drop(which) {
    this.keep();
    this.send('drop_stored', which);
  }

  get which() { return { down: this.row.key, moment: this.row.moment }; }

  /**
   * Whether it was done.
   * @template {Change} Name
   * @param {Name} name
   * @param {server.Commands[Name]} args
   */
  async send(name, args) {
    setText(this.problem, '');
    setText(this.reply, '');
    const { ok, message } = await this.app.connection.ask(name, args, '');
    setText(ok ? this.reply : this.problem, message);
    if (ok && name === 'drop_stored') toast(message, 'good'); // its row goes
    return ok;
  }
}
