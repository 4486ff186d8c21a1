// @ts-check
// One output key of a state, to be filled in: its present value in the question says how.
import { h, setText } from '../page/dom.js';

/** @typedef {'list' | 'object' | 'number' | 'boolean' | 'text' | 'json'} PlainKind */
/**
 * @typedef {object} Kind
 * @property {string} says what a value is
 * @property {string} hint
 * @property {(value: unknown) => boolean} fits
 * @property {string} wrong what it is, for a value that does not fit
 */

const UNSET = '; empty: not set';
const NOT_JSON = 'is not JSON: text needs "quotes"';
/** @type {{ [name in PlainKind]: Kind }} */
const KINDS = {
  list: { says: 'a JSON list', hint: 'JSON list, such as [1, 2]' + UNSET, fits: Array.isArray,
    wrong: 'is a list, such as [1, 2]' },
  object: { says: 'a JSON object', hint: 'JSON object, such as {"a": 1}' + UNSET, fits: isObject,
    wrong: 'is an object, such as {"a": 1}' },
  number: { says: 'a number', hint: 'number' + UNSET, fits: (value) => typeof value === 'number',
    wrong: 'is a number' },
  boolean: { says: 'true or false', hint: '', fits: (value) => typeof value === 'boolean',
    wrong: 'is true or false' },
  text: { says: 'text', hint: 'text' + UNSET, fits: () => true, wrong: '' },
  json: { says: 'JSON', hint: 'JSON' + UNSET, fits: () => true, wrong: '' },
};

/** @param {unknown} value */
function isObject(value) { return typeof value === 'object' && !Array.isArray(value); }

/**
 * Of a ROS message, or of a list of them.
 * @param {string} type
 * @returns {Kind}
 */
function messageKind(type) {
  const one = type.replace(/\[\]$/, '');
  if (one !== type) {
    return { says: 'a JSON list of ' + one, hint: 'JSON list of fields of ' + one + UNSET,
      fits: Array.isArray, wrong: 'is a list of ' + one };
  }
  return { says: 'JSON fields of ' + one, hint: 'JSON fields of ' + one + UNSET, fits: isObject,
    wrong: 'is an object with fields of ' + one };
}

/**
 * What kind of plain value an item of the userdata has now.
 * @param {server.UserdataItem | undefined} item
 * @returns {PlainKind}
 */
function plainKindOf(item) {
  if (!item || item.note) return 'json';
  let value;
  try {
    value = JSON.parse(item.value);
  } catch (err) {
    return 'json'; // too long to be shown whole
  }
  if (Array.isArray(value)) return 'list';
  if (typeof value === 'string') return 'text';
  if (typeof value === 'number') return 'number';
  if (typeof value === 'boolean') return 'boolean';
  return value === null ? 'json' : 'object';
}

/**
 * The fields of all outputs of a question's state.
 * @param {server.Question} question
 * @param {() => void} onInput
 */
export function outputFields({ outputs, userdata }, onInput) {
  return outputs.map((key) => (
    new OutputField(key, userdata.find((item) => item.key === key), onInput)));
}

/**
 * What is filled in; null where something is wrong, which `problem` says then.
 * @param {OutputField[]} fields
 * @param {Element} problem
 */
export function readOutputs(fields, problem) {
  setText(problem, '');
  try {
    return fields.flatMap((field) => field.read() || []);
  } catch (err) {
    setText(problem, err instanceof Error ? err.message : String(err));
    return null;
  }
}

export class OutputField {
  /**
   * @param {string} key
   * @param {server.UserdataItem | undefined} item of the userdata that has this key now
   * @param {() => void} onInput something was typed
   */
  constructor(key, item, onInput) {
    this.key = key;
    this.type = item && !item.note && item.type.includes('/') ? item.type : '';
    /** @type {PlainKind | 'message'} */
    this.name = this.type ? 'message' : plainKindOf(item);
    this.kind = this.name === 'message' ? messageKind(this.type) : KINDS[this.name];
    this.input = this.makeInput(onInput);
    this.root = h('label', { class: 'output-field' },
      h('span', {}, key, h('span', { class: 'dim kind' }, ' ' + this.kind.says)), this.input);
  }

  /** @param {() => void} onInput */
  makeInput(onInput) {
    const properties = { 'data-output': this.key, oninput: onInput, onchange: onInput,
      'aria-label': 'Value of ' + this.key + ': ' + this.kind.says };
    if (this.name !== 'boolean') {
      const looks = { rows: 1, spellcheck: 'false', placeholder: this.kind.hint };
      return h('textarea', { ...looks, ...properties });
    }
    return h('select', properties, h('option', { value: '' }, 'not set'),
      h('option', { value: 'true' }, 'true'), h('option', { value: 'false' }, 'false'));
  }

  /**
   * null where it is not set. Throws an Error that says what is allowed.
   * @returns {server.Output | null}
   */
  read() {
    const typed = this.input.value.trim();
    if (!typed) return null;
    return { key: this.key, value: this.parse(typed), type: this.type };
  }

  /**
   * @param {string} typed
   * @returns {unknown}
   */
  parse(typed) {
    let value;
    try {
      value = JSON.parse(typed);
    } catch (err) {
      if (this.name !== 'text') this.refuse(this.notJson);
    }
    if (this.name === 'text') return typeof value === 'string' ? value : typed;
    const none = value === null && !this.type;
    if (!none && !this.kind.fits(value)) this.refuse(this.kind.wrong);
    return value;
  }

  get notJson() {
    if (this.name === 'json') return NOT_JSON;
    return this.kind.wrong + (this.name === 'number' ? '' : ', written as JSON');
  }

  /**
   * @param {string} why
   * @returns {never}
   */
  refuse(why) {
    this.input.focus();
    throw new Error(this.key + ' ' + why + '.');
  }
}
