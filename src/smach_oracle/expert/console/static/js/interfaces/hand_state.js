// @ts-check
// What a hand does: in a word, and in numbers.

/** @typedef {import('../server').HandState} HandState */
/** @typedef {import('../server').Manipulation} Manipulation */

/**
 * Whether it moves, and what is in its way; `kind`: good, warn or bad.
 * @param {HandState | undefined} state
 */
export function lightOf(state) {
  if (!state) return { text: 'Nothing is heard of the hand yet.', kind: '' };
  if (state.refused) return { text: 'Refused: ' + state.refused, kind: 'bad' };
  if (state.limit) return { text: state.limit, kind: 'warn' };
  return state.moving ? { text: 'Moves freely', kind: 'good' } : { text: 'Stands', kind: '' };
}

/**
 * @param {Manipulation} manipulation
 * @param {HandState} state
 * @returns {[name: string, value: string][]}
 */
export function factsOf({ boxes, arms }, state) {
  return [['Speed', speedOf(state)],
    ['Clearance', state.clearance === null ? 'nothing known is near'
      : (100 * state.clearance).toFixed(1) + ' cm'],
    ['Around', boxes ? boxes + (boxes === 1 ? ' box' : ' boxes') + ' in its collision map'
      : 'no collision map: only its own body slows the hand'],
    ['Gripper', gripperOf(state)],
    ['Tool at', (arms.length > 1 ? state.arm + ': ' : '') + state.at.map((value, axis) => (
      'xyz'[axis] + ' ' + (value === null ? '–' : value.toFixed(3)))).join('  ')]];
}

/** @param {HandState} state */
function speedOf({ speed, moving, share }) {
  const now = speed === null ? '–' : Math.round(1000 * speed) + ' mm/s';
  const asked = moving && share !== null;
  return now + (asked ? ', ' + Math.round(100 * share) + ' % of what is asked' : '');
}

/** @param {HandState} state */
function gripperOf({ gripper, stalled }) {
  if (gripper === null) return 'not moved yet';
  return (1000 * gripper).toFixed(0) + ' mm' + (stalled ? ', holds something' : '');
}
