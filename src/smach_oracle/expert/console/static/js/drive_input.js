// What a person holds: buttons by mouse and touch, keys, a gamepad. Everything is let go where it cannot be seen to be held.
import { typing } from './dom.js';

export const MOVES = [['forward', 'linear', 0, 1], ['back', 'linear', 0, -1], ['left', 'linear', 1, 1], ['right', 'linear', 1, -1], ['up', 'linear', 2, 1], ['down', 'linear', 2, -1],
  ['roll left', 'angular', 0, -1], ['roll right', 'angular', 0, 1], ['tilt up', 'angular', 1, -1], ['tilt down', 'angular', 1, 1], ['turn left', 'angular', 2, 1], ['turn right', 'angular', 2, -1]];
export const KEYS = { KeyW: 'forward', KeyS: 'back', KeyA: 'left', KeyD: 'right', KeyR: 'up', KeyF: 'down', KeyQ: 'roll left', KeyE: 'roll right', ArrowUp: 'tilt up', ArrowDown: 'tilt down', ArrowLeft: 'turn left', ArrowRight: 'turn right', KeyO: 'open', KeyC: 'close' };
const DEAD_ZONE = 0.12;
const HOLD_BUTTONS = [4, 5]; // the shoulder buttons: the gamepad's dead-man

// `changed(held)` is called as soon as something is pressed, and when everything is let go.
export class DriveInput {
  constructor(changed) {
    this.changed = changed;
    this.active = false;
    this.padSpent = true; // its dead-man must be let go before it holds (again)
    this.pressed = new Map(); // what holds it -> move
    this.off = new AbortController();
    const listen = (target, type, f) => target.addEventListener(type, f, { signal: this.off.signal, capture: true });
    listen(window, 'keydown', (event) => this.key(event, true));
    listen(window, 'keyup', (event) => this.key(event, false));
    for (const type of ['blur', 'pagehide', 'freeze']) listen(window, type, () => this.releaseAll());
    listen(window, 'contextmenu', (event) => this.menu(event));
    listen(document, 'visibilitychange', () => this.releaseAll());
  }

  stop() {
    this.releaseAll();
    this.off.abort();
  }

  key(event, down) {
    const move = KEYS[event.code];
    if (!move || !this.active) return;
    if (down && (event.ctrlKey || event.metaKey || event.altKey || typing(event.target))) {
      if (!typing(event.target)) this.releaseAll();
      return;
    }
    event.preventDefault();
    event.stopImmediatePropagation(); // these letters mean something else elsewhere on the page
    if (down && !event.repeat) this.press(event.code, move);
    else if (!down) this.release(event.code);
  }

  // A finger that rests on a button asks for a menu: there is none. Elsewhere one may cover what is held.
  menu(event) {
    if (event.target instanceof Element && event.target.closest('.pad')) event.preventDefault();
    else this.releaseAll();
  }

  // Make an element hold a move for as long as it is pressed.
  bind(element, move) {
    const id = Symbol(move);
    const on = (type, f) => element.addEventListener(type, f, { signal: this.off.signal });
    on('pointerdown', (event) => {
      if (event.button || !this.active) return;
      event.preventDefault();
      element.setPointerCapture(event.pointerId);
      this.press(id, move);
    });
    for (const type of ['pointerup', 'pointercancel', 'lostpointercapture']) on(type, () => this.release(id));
  }

  press(id, move) {
    const before = this.pressed.size;
    this.pressed.set(id, move);
    if (!before) this.changed(true);
  }

  release(id) {
    if (this.pressed.delete(id) && !this.pressed.size) this.changed(false);
  }

  releaseAll() {
    const held = this.pressed.size || this.padHeld;
    this.pressed.clear();
    this.padHeld = false;
    this.padSpent = true;
    if (held) this.changed(false);
  }

  // What is held now: {held, linear, angular, gripper, moves}.
  read() {
    const wish = { linear: [0, 0, 0], angular: [0, 0, 0], gripper: '', moves: new Set(this.pressed.values()) };
    for (const move of wish.moves) {
      const found = MOVES.find(([name]) => name === move);
      if (found) wish[found[1]][found[2]] += found[3];
      else wish.gripper = move;
    }
    const pad = this.active && document.hasFocus() && !document.hidden ? this.pad(wish) : false;
    const letGo = this.padHeld && !pad && !this.pressed.size;
    this.padHeld = pad;
    if (letGo) this.changed(false); // which reads again
    for (const part of [wish.linear, wish.angular]) part.forEach((value, axis) => { part[axis] = Math.max(-1, Math.min(1, value)); });
    wish.held = this.pressed.size > 0 || pad;
    return wish;
  }

  pad(wish) {
    const pads = [...(navigator.getGamepads ? navigator.getGamepads() : [])].filter((each) => each && each.connected);
    const pad = pads.find((each) => each.mapping === 'standard');
    this.gamepad = pad ? pad.id + ' moves while a shoulder button is held.' : pads.length ? pads[0].id + ' has a layout that this browser does not know: it moves nothing.' : '';
    if (!pad || !HOLD_BUTTONS.some((index) => pad.buttons[index] && pad.buttons[index].pressed)) this.padSpent = !pad;
    else if (!this.padSpent) return this.readPad(pad, wish);
    return false;
  }

  readPad(pad, wish) {
    const axis = (index) => { const value = pad.axes[index] || 0; return Math.abs(value) < DEAD_ZONE ? 0 : value; };
    const button = (index) => (pad.buttons[index] ? pad.buttons[index].value : 0);
    wish.linear[0] -= axis(1);
    wish.linear[1] -= axis(0);
    wish.linear[2] += button(7) - button(6);
    wish.angular[0] += button(15) - button(14);
    wish.angular[1] += axis(3);
    wish.angular[2] -= axis(2);
    wish.gripper = button(0) ? 'close' : button(1) ? 'open' : wish.gripper;
    return true;
  }
}
