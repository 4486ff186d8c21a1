// @ts-check
// What the outcomes of a state mean: which one says that its work is done.

const USUAL = 'succeeded';
/** @type {{ [meaning in server.OutcomeChoice['meaning']]: string }} */
export const MEANINGS = { success: '', failure: 'counts as a failure',
  preempted: 'counts as stopped', 'other end': '' };

/**
 * The one outcome that says that the work is done; undefined where none does, or several do and
 * none has the usual name.
 * @param {server.OutcomeChoice[]} choices
 */
export function successOf(choices) {
  const good = choices.filter(({ meaning }) => meaning === 'success');
  return good.length === 1 ? good[0] : good.find(({ outcome }) => outcome === USUAL);
}
