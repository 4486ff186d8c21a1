// One output key of a state, to be filled in: what the question knows of its present value says how.
import { h } from './dom.js';

const KINDS = {
  list: { says: 'a JSON list', hint: 'JSON list, such as [1, 2]; empty: not set', fits: Array.isArray, wrong: 'is a list, such as [1, 2]' },
  object: { says: 'a JSON object', hint: 'JSON object, such as {"a": 1}; empty: not set', fits: (value) => typeof value === 'object' && !Array.isArray(value), wrong: 'is an object, such as {"a": 1}' },
  number: { says: 'a number', hint: 'number; empty: not set', fits: (value) => typeof value === 'number', wrong: 'is a number' },
  boolean: { says: 'true or false' },
  text: { says: 'text', hint: 'text; empty: not set' },
  any: { says: 'JSON', hint: 'JSON; empty: not set', fits: () => true, wrong: '' },
};

// What kind of value an item of the userdata has now.
function kindOf(item) {
  if (!item || item.note) return 'any';
  if (item.type.includes('/')) return item.type.endsWith('[]') ? 'messages' : 'message';
  let value;
  try {
    value = JSON.parse(item.value);
  } catch (err) {
    return 'any'; // too long to be shown whole
  }
  if (Array.isArray(value)) return 'list';
  if (value === null) return 'any';
  return { object: 'object', number: 'number', boolean: 'boolean', string: 'text' }[typeof value];
}

export class OutputField {
  // `onInput()`: something was typed
  constructor(key, item, onInput) {
    this.key = key;
    this.name = kindOf(item);
    this.type = this.name.startsWith('message') ? item.type : '';
    this.kind = KINDS[this.name] || this.ofMessages(item.type);
    const given = { 'data-output': key, 'aria-label': 'Value of ' + key + ': ' + this.kind.says, oninput: onInput, onchange: onInput };
    this.input = this.name === 'boolean'
      ? h('select', given, h('option', { value: '' }, 'not set'), h('option', { value: 'true' }, 'true'), h('option', { value: 'false' }, 'false'))
      : h('textarea', Object.assign({ rows: 1, spellcheck: 'false', placeholder: this.kind.hint }, given));
    this.root = h('label', { class: 'output-field' }, h('span', {}, key, h('span', { class: 'dim kind' }, ' ' + this.kind.says)), this.input);
  }

  ofMessages(type) {
    const one = type.replace(/\[\]$/, '');
    return this.name === 'messages' ? { says: 'a JSON list of ' + one, hint: 'JSON list of fields of ' + one + '; empty: not set', fits: Array.isArray, wrong: 'is a list of ' + one }
      : { says: 'JSON fields of ' + one, hint: 'JSON fields of ' + one + '; empty: not set', fits: (value) => typeof value === 'object' && !Array.isArray(value), wrong: 'is an object with fields of ' + one };
  }

  // {key, value, type}; null where it is not set. Throws an Error that says what is allowed.
  read() {
    const typed = this.input.value.trim();
    if (!typed) return null;
    let value;
    try {
      value = JSON.parse(typed);
    } catch (err) {
      if (this.name !== 'text') this.refuse(this.name === 'any' ? 'is not JSON: text needs "quotes"' : this.kind.wrong + (this.name === 'number' ? '' : ', written as JSON'));
    }
    if (this.name === 'text') value = typeof value === 'string' ? value : typed;
    else if (this.name !== 'boolean' && !(value === null && !this.type) && !this.kind.fits(value)) this.refuse(this.kind.wrong);
    return { key: this.key, value, type: this.type };
  }

  refuse(why) {
    this.input.focus();
    throw new Error(this.key + ' ' + why + '.');
  }
}
