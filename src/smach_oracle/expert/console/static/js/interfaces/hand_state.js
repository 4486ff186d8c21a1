// @ts-check
// What a hand does: in a word, and in numbers.

import { percent } from '../page/format.js';

const SLOWED = 0.995; // of what is asked: what is above it is called 100 %

/**
 * Whether it moves, and what is in its way; `kind`: good, warn or bad; `share`: how much of the
 * asked speed is left, 0 to 1.
 * @param {server.HandState | undefined} state
 */
export function lightOf(state) {
  if (!state) return { text: 'Nothing is heard of the hand yet.', kind: '', share: 0 };
  if (state.refused) return { text: 'Refused: ' + state.refused, kind: 'bad', share: 0 };
  const share = state.moving ? state.share ?? 1 : 0;
  const slowed = share > 0 && share < SLOWED ? 'Slowed to ' + percent(share) + ': ' : '';
  if (state.limit) return { text: slowed + state.limit, kind: 'warn', share };
  return { text: state.moving ? 'Moves freely' : 'Stands', kind: state.moving ? 'good' : '',
    share };
}

/**
 * @param {server.Manipulation} manipulation
 * @param {server.HandState} state
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

/** @param {server.HandState} state */
function speedOf({ speed, moving, share }) {
  const now = speed === null ? '–' : Math.round(1000 * speed) + ' mm/s';
  const asked = moving && share !== null;
  return now + (asked ? ', ' + percent(share) + ' of what is asked' : '');
}

/** @param {server.HandState} state */
function gripperOf({ gripper, stalled }) {
  if (gripper === null) return 'not moved yet';
  return (1000 * gripper).toFixed(0) + ' mm' + (stalled ? ', holds something' : '');
}
