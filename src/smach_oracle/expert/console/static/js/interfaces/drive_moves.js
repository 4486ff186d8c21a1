// @ts-check
// The moves of a hand that a person can hold, and the keys that do.

/** @typedef {'forward' | 'back' | 'left' | 'right' | 'up' | 'down'} Way */
/**
 * @typedef {'roll left' | 'roll right' | 'tilt up' | 'tilt down' | 'turn left' | 'turn right'} Turn
 */
/** @typedef {'open' | 'close'} GripperMove */
/** @typedef {Way | Turn | GripperMove} Move */
/** @typedef {'linear' | 'angular'} MoveKind */
/**
 * @typedef {object} Motion
 * @property {Way | Turn} move
 * @property {MoveKind} kind
 * @property {0 | 1 | 2} axis
 * @property {1 | -1} sign
 */

/** @type {Motion[]} */
export const MOTIONS = [
  { move: 'forward', kind: 'linear', axis: 0, sign: 1 },
  { move: 'back', kind: 'linear', axis: 0, sign: -1 },
  { move: 'left', kind: 'linear', axis: 1, sign: 1 },
  { move: 'right', kind: 'linear', axis: 1, sign: -1 },
  { move: 'up', kind: 'linear', axis: 2, sign: 1 },
  { move: 'down', kind: 'linear', axis: 2, sign: -1 },
  { move: 'roll left', kind: 'angular', axis: 0, sign: -1 },
  { move: 'roll right', kind: 'angular', axis: 0, sign: 1 },
  { move: 'tilt up', kind: 'angular', axis: 1, sign: -1 },
  { move: 'tilt down', kind: 'angular', axis: 1, sign: 1 },
  { move: 'turn left', kind: 'angular', axis: 2, sign: 1 },
  { move: 'turn right', kind: 'angular', axis: 2, sign: -1 },
];

/**
 * By move: the code of its key, what a button shows of that, and the button's sign.
 * @type {{ [move in Move]: { code: string, key: string, sign: string } }}
 */
export const BUTTONS = {
  forward: { code: 'KeyW', key: 'W', sign: '↑' },
  back: { code: 'KeyS', key: 'S', sign: '↓' },
  left: { code: 'KeyA', key: 'A', sign: '←' },
  right: { code: 'KeyD', key: 'D', sign: '→' },
  up: { code: 'KeyR', key: 'R', sign: '⤒' },
  down: { code: 'KeyF', key: 'F', sign: '⤓' },
  'roll left': { code: 'KeyQ', key: 'Q', sign: '↺' },
  'roll right': { code: 'KeyE', key: 'E', sign: '↻' },
  'tilt up': { code: 'ArrowUp', key: '↑', sign: '⇧' },
  'tilt down': { code: 'ArrowDown', key: '↓', sign: '⇩' },
  'turn left': { code: 'ArrowLeft', key: '←', sign: '⟲' },
  'turn right': { code: 'ArrowRight', key: '→', sign: '⟳' },
  open: { code: 'KeyO', key: 'O', sign: '⟷ Open' },
  close: { code: 'KeyC', key: 'C', sign: '⇥⇤ Close' },
};

export const MOVES = /** @type {Move[]} */ (Object.keys(BUTTONS));

/** @type {Map<string, Move>} */
export const MOVE_OF_KEY = new Map(MOVES.map((move) => [BUTTONS[move].code, move]));
