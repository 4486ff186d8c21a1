// @ts-check
// The counts of the paper's Table I.
import { h } from '../page/dom.js';
import { duration, percent } from '../page/format.js';

const OTHER_END = 'Other end'; // the outcome says neither success nor failure
const COLUMNS = ['Experiment', 'Variant', 'Trials', 'Failures', 'Oracle recoveries', 'Questions',
  'Expert answered', 'Ended in failure', OTHER_END, 'Waited until well'];

/**
 * @param {string} caption
 * @param {server.CountsRow[]} rows
 */
export function countsTable(caption, rows) {
  const others = rows.some(({ endings }) => endings.other);
  const titles = COLUMNS.filter((title) => others || title !== OTHER_END)
    .map((title) => h('th', { scope: 'col' }, title));
  return h('table', {}, h('caption', {}, caption), h('thead', {}, h('tr', {}, titles)),
    h('tbody', {}, rows.map((row) => rowOf(row, others))));
}

/**
 * @param {server.CountsRow} row
 * @param {boolean} others whether there is a column of other ends
 */
function rowOf(row, others) {
  const { experiment, arm, oracle, trials, counts, endings, unwell_s: unwell } = row;
  /** @param {number} found of the trials */
  const share = (found) => h('td', { class: 'number' }, found,
    h('span', { class: 'dim' }, ' ' + percent(found / trials)));
  return h('tr', {}, h('th', { scope: 'row' }, experiment),
    h('td', {}, arm || (oracle ? 'with oracle' : 'without oracle')),
    h('td', { class: 'number' }, trials),
    share(counts.failures.trials), share(counts.recoveries.trials), share(counts.questions.trials),
    share(counts.answered.trials), share(endings.failure), others && share(endings.other || 0),
    h('td', { class: 'number' }, unwell ? duration(unwell) : '–'));
}
