// @ts-check
// What a person holds: buttons by mouse, touch, Enter and Space, keys, a gamepad. Everything is let
// go where it cannot be seen to be held.
import { vector } from '../drawing/transforms.js';
import { longSince, sayTooSoon } from '../page/deliberate.js';
import { modified, typing } from '../page/dom.js';
import { keysOn } from '../page/shortcuts.js';
import { MOTIONS, MOVE_OF_KEY } from './drive_moves.js';
import { GamepadInput } from './gamepad.js';
import { holdByKey } from './held_by_key.js';

/** @typedef {import('./drive_moves.js').Move} Move */

export class DriveInput {
  /**
   * @param {(held: boolean) => void} changed something was pressed, where nothing was before, or
   *   everything was let go
   */
  constructor(changed) {
    this.changed = changed;
    this.sinceMs = Infinity; // when keys and the gamepad have come to move the hand
    this.gamepad = new GamepadInput();
    /** @type {Map<string | symbol, Move>} */
    this.pressed = new Map(); // by what holds it: a key, a button
    this.off = new AbortController();
    this.listen();
  }

  /** Whether what is held moves the hand. */
  get active() { return this.sinceMs < Infinity; }

  set active(active) {
    if (active !== this.active) this.sinceMs = active ? performance.now() : Infinity;
  }

  /** They mean something else now, or nobody has seen what they mean. */
  unsettle() { if (this.active) this.sinceMs = performance.now(); }

  listen() {
    const first = { signal: this.off.signal, capture: true };
    const releaseAll = () => this.releaseAll();
    window.addEventListener('keydown', (event) => this.key(event, true), first);
    window.addEventListener('keyup', (event) => this.key(event, false), first);
    for (const type of ['blur', 'pagehide', 'freeze']) {
      window.addEventListener(type, releaseAll, first);
    }
    window.addEventListener('contextmenu', (event) => this.menu(event), first);
    document.addEventListener('visibilitychange', () => {
      this.unsettle();
      this.releaseAll();
    }, first);
  }

  stop() {
    this.releaseAll();
    this.off.abort();
  }

  /**
   * @param {KeyboardEvent} event
   * @param {boolean} down
   */
  key(event, down) {
    const move = MOVE_OF_KEY.get(event.code);
    if (!move || !this.active) return;
    if (down && (typing(event.target) || !keysOn())) return;
    if (down && modified(event)) {
      this.releaseAll();
      return;
    }
    event.preventDefault();
    event.stopImmediatePropagation(); // these letters mean something else elsewhere on the page
    if (!down) this.release(event.code); // never too soon
    else if (!event.repeat) {
      if (longSince(this.sinceMs)) this.press(event.code, move);
      else sayTooSoon();
    }
  }

  /**
   * A finger that rests on a button asks for a menu: there is none. Elsewhere one may cover what is
   * held.
   * @param {MouseEvent} event
   */
  menu(event) {
    if (event.target instanceof Element && event.target.closest('.pad')) event.preventDefault();
    else this.releaseAll();
  }

  /**
   * Make an element hold a move for as long as it is pressed.
   * @param {HTMLElement} element
   * @param {Move} move
   */
  bind(element, move) {
    const id = Symbol(move);
    const options = { signal: this.off.signal };
    element.addEventListener('pointerdown', (event) => {
      if (event.button || !this.active) return;
      event.preventDefault();
      element.setPointerCapture(event.pointerId);
      this.press(id, move);
    }, options);
    for (const type of ['pointerup', 'pointercancel', 'lostpointercapture']) {
      element.addEventListener(type, () => this.release(id), options);
    }
    const byKey = Symbol(move); // a finger that is lifted does not let go what a key holds
    holdByKey(element, { press: () => { if (this.active) this.press(byKey, move); },
      release: () => this.release(byKey) }, options);
  }

  /**
   * @param {string | symbol} id
   * @param {Move} move
   */
  press(id, move) {
    const before = this.pressed.size;
    this.pressed.set(id, move);
    if (!before) this.changed(true);
  }

  /** @param {string | symbol} id */
  release(id) {
    if (this.pressed.delete(id) && !this.pressed.size) this.changed(false);
  }

  releaseAll() {
    const held = this.pressed.size > 0 || this.gamepad.held;
    this.pressed.clear();
    this.gamepad.release();
    if (held) this.changed(false);
  }

  /** The moves that are held by keys and buttons. */
  get moves() { return new Set(this.pressed.values()); }

  /**
   * What is held now.
   * @returns {server.DriveWish}
   */
  read() {
    const wish = this.readPressed();
    const before = this.gamepad.held;
    const meant = longSince(this.sinceMs);
    if (!meant) this.gamepad.release(); // what is held by then does not count later
    this.gamepad.read(wish, meant && document.hasFocus() && !document.hidden);
    const letGo = before && !this.gamepad.held && !this.pressed.size;
    if (letGo) this.changed(false); // which reads again
    /** @param {number} value */
    const bounded = (value) => Math.max(-1, Math.min(1, value));
    const { linear, angular, gripper } = wish;
    return { held: this.pressed.size > 0 || this.gamepad.held, gripper,
      linear: vector((axis) => bounded(linear[axis])),
      angular: vector((axis) => bounded(angular[axis])) };
  }

  /** @returns {server.DriveWish} */
  readPressed() {
    const { moves } = this;
    /** @type {server.DriveWish} */
    const wish = { held: false, linear: [0, 0, 0], angular: [0, 0, 0], gripper: '' };
    for (const { move, kind, axis, sign } of MOTIONS) if (moves.has(move)) wish[kind][axis] += sign;
    for (const move of moves) if (move === 'open' || move === 'close') wish.gripper = move;
    return wish;
  }
}
