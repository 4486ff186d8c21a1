// @ts-check
// The states before which a machine pauses.
import { h } from '../page/dom.js';

/** @typedef {(pattern: string, remove: boolean) => Promise<boolean>} ChangeBreakpoint */

/**
 * @param {string[]} patterns
 * @param {boolean} may whether they may be changed
 * @param {ChangeBreakpoint} change
 */
export function breakpoints(patterns, may, change) {
  return h('details', { class: 'breakpoints' },
    h('summary', {}, 'Breakpoints' + (patterns.length ? ' (' + patterns.length + ')' : '')),
    h('div', { class: 'row wrap' }, patterns.map((pattern) => h('button', { key: pattern,
      class: 'tool', 'data-breakpoint': pattern, disabled: !may,
      'aria-label': 'Take the breakpoint ' + pattern + ' away',
      onclick: () => change(pattern, true) }, pattern, ' ✕'))),
    h('form', { class: 'row', hidden: !may, onsubmit: (event) => add(event, change) },
      h('input', { type: 'text', maxlength: 400, spellcheck: false, autocomplete: 'off',
        'aria-label': 'Pause before these states', placeholder: 'PICK, PICK_*' }),
      h('button', { class: 'tool', type: 'submit' }, 'Pause there')));
}

/**
 * @param {SubmitEvent} event
 * @param {ChangeBreakpoint} change
 */
async function add(event, change) {
  event.preventDefault();
  const field = event.target instanceof Element && event.target.querySelector('input');
  const pattern = field && field.value.trim();
  if (field && pattern && await change(pattern, false)) field.value = '';
}
