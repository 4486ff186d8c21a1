// @ts-check
// A gamepad: it moves a hand while a shoulder button is held, its dead-man.

const DEAD_ZONE = 0.12;
const HOLD_BUTTONS = [4, 5]; // the shoulder buttons
const NO_LAYOUT = ' has a layout that this browser does not know: it moves nothing.';

export class GamepadInput {
  constructor() {
    this.words = ''; // about the gamepad that is there
    this.held = false;
    this.spent = true; // its dead-man must be let go before it holds (again)
  }

  /** Nothing is held, until the dead-man was let go. */
  release() {
    this.held = false;
    this.spent = true;
  }

  /**
   * Add what it says, where it is held.
   * @param {server.DriveWish} wish
   * @param {boolean} active whether it may hold
   */
  read(wish, active) {
    this.held = active && this.readFirst(wish);
  }

  /**
   * Of the first gamepad whose layout is known; whether it is held.
   * @param {server.DriveWish} wish
   */
  readFirst(wish) {
    const all = navigator.getGamepads ? navigator.getGamepads() : [];
    const pads = all.flatMap((each) => (each && each.connected ? [each] : []));
    const pad = pads.find((each) => each.mapping === 'standard');
    this.words = pads.length ? pads[0].id + NO_LAYOUT : '';
    if (pad) this.words = pad.id + ' moves while a shoulder button is held.';
    const pressed = pad && HOLD_BUTTONS.some((index) => pad.buttons[index]?.pressed);
    if (!pad || !pressed) {
      this.spent = !pad;
      return false;
    }
    if (this.spent) return false;
    addPad(pad, wish);
    return true;
  }
}

/**
 * @param {Gamepad} pad
 * @param {server.DriveWish} wish
 */
function addPad(pad, wish) {
  /** @param {number} index */
  const axis = (index) => {
    const value = pad.axes[index] || 0;
    return Math.abs(value) < DEAD_ZONE ? 0 : value;
  };
  /** @param {number} index */
  const button = (index) => pad.buttons[index]?.value || 0;
  wish.linear[0] -= axis(1);
  wish.linear[1] -= axis(0);
  wish.linear[2] += button(7) - button(6);
  wish.angular[0] += button(15) - button(14);
  wish.angular[1] += axis(3);
  wish.angular[2] -= axis(2);
  if (button(0)) wish.gripper = 'close';
  else if (button(1)) wish.gripper = 'open';
}
