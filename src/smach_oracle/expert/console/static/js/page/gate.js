// @ts-check
// What is asked before a command is sent: whether an answer still fits what is heard, and who gives
// it. What stops or lets go passes at once.

/** @typedef {keyof server.Commands} Name */

/** @type {Set<Name>} */
const ANSWERING = new Set(['answer', 'hand_over']);
/** @type {Set<Name>} */
const GOING_ON = new Set(['resume_machine', 'step_machine', 'confirm_state']);
// what a robot, its record or other people have under a name
/** @type {Set<Name>} */
const NAMED = new Set(['claim', 'take_over', 'answer', 'mark', 'use_frame', 'hand_over',
  'give_up_interface', 'take_wheel', 'set_breakpoint', 'goto_stored', 'edit_stored', 'drop_stored',
  'write_note', 'drop_note',
  ...GOING_ON]);
const NO_NAME = 'Not done: your name is needed for it.';

export class Gate {
  /**
   * @param {page.Liveness} liveness
   * @param {() => boolean} named whether the server knows who uses this page
   * @param {() => Promise<boolean>} askName whether a name was given
   */
  constructor(liveness, named, askName) {
    this.liveness = liveness;
    this.named = named;
    this.askName = askName;
  }

  /**
   * @param {Name} name
   * @param {{ question?: string, robot?: string }} args
   * @returns {Promise<server.Reply | null> | null} a refusal that is there already; null: it is
   *   sent
   */
  before(name, { question, robot }) {
    const asked = ANSWERING.has(name)
      && this.liveness.store.questions.find(({ key }) => key === question);
    const held = GOING_ON.has(name) && robot;
    const refusal = asked ? this.liveness.refusal(asked)
      : held && this.liveness.refusalOfRobot(held);
    if (refusal) return Promise.resolve(refused(refusal));
    if (!NAMED.has(name) || this.named()) return null;
    return this.askName().then((given) => (given ? null : refused(NO_NAME)));
  }

  /**
   * What is told with a command beside its arguments.
   * @param {Name} name
   */
  beside(name) {
    return ANSWERING.has(name) || GOING_ON.has(name) ? { seen: this.liveness.beat } : {};
  }
}

/**
 * @param {string} message
 * @returns {server.Reply}
 */
function refused(message) { return { re: 0, ok: false, message }; }
