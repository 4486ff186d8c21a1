// @ts-check
// How an interface ends: the outcome of the state whose work it did, and the reply of the robot.
import { successOf } from '../answering/outcome_choices.js';
import { NoReply, unlessLost } from '../page/connection.js';
import { h, pick, setText } from '../page/dom.js';

const UNKNOWN = 'No reply came: whether it was carried out is not known.';
const LOST = 'The connection was lost before the robot had confirmed; try again.';

/** @param {server.Question} question */
export function outcomeChoice({ supersede }) {
  const done = successOf(supersede);
  return pick({ 'aria-label': 'Outcome' }, supersede.map(({ outcome, target }) => (
    [outcome, outcome + ' → ' + target])), done?.outcome || '', () => {});
}

/** @param {HTMLSelectElement} choice */
export function outcomeRow(choice) {
  return h('label', { class: 'outcome-row' },
    h('span', { class: 'dim' }, 'The state ends with'), choice);
}

/**
 * @typedef {object} Ending a panel of an interface that ends
 * @property {page.App} app
 * @property {boolean} busy
 * @property {Element} problem
 * @property {() => void} onEnd
 * @property {() => void} draw
 */

/**
 * End an interface; whether the robot has done so.
 * @template {'hand_over' | 'give_up_interface'} Name
 * @param {Ending} panel
 * @param {Name} command
 * @param {server.Commands[Name]} args
 */
export async function settle(panel, command, args) {
  if (panel.busy) return false;
  panel.busy = true;
  setText(panel.problem, '');
  panel.draw();
  const reply = await replyTo(panel.app, panel.problem, command, args);
  panel.busy = false;
  if (reply?.ok) panel.onEnd();
  else if (reply) setText(panel.problem, reply.message);
  panel.draw();
  return Boolean(reply?.ok);
}

/**
 * The reply to a command; null where the connection was lost, which `problem` says then.
 * @template {keyof server.Commands} Name
 * @param {page.App} app
 * @param {Element} problem
 * @param {Name} command
 * @param {server.Commands[Name]} args
 */
export async function replyTo(app, problem, command, args) {
  try {
    return await app.connection.request(command, args);
  } catch (err) {
    unlessLost(err);
    setText(problem, err instanceof NoReply ? UNKNOWN : LOST);
    return null;
  }
}
