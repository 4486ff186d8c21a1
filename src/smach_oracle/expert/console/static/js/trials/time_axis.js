// @ts-check
// What is on the time axis of a trial: lanes, bars, marks and ticks. Pure.

/**
 * Events that are marked, and how.
 * @type {{ [kind in server.EventName]?: string }}
 */
export const MARKS = { failure: 'bad', decision: 'oracle', jump: 'oracle', supersede: 'expert',
  give_up: 'bad', warning: 'warn', query_opened: 'expert', query_claimed: 'expert',
  query_answered: 'expert', query_expired: 'bad', interface_start: 'expert',
  interface_end: 'expert', precondition_start: 'oracle', precondition_end: 'oracle',
  preempt: 'warn', health_wait_start: 'warn', health_wait_end: 'warn' };
const STEPS_S = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1800,
  3600];
const MOST_TICKS = 8;

/** @param {server.TrialEvent} event */
export function laneOf({ kind, path, state }) {
  const asked = kind.startsWith('query') || kind.startsWith('interface');
  if (asked || kind === 'supersede') return 'expert';
  if (MARKS[kind] === 'oracle' || kind === 'give_up') return 'oracle';
  return state ? path + '/' + state : 'oracle';
}

/**
 * In the order of their first event; oracle and expert at the end.
 * @param {server.TrialEvent[]} events
 */
export function lanesOf(events) {
  /** @type {Set<string>} */
  const seen = new Set();
  for (const event of events) {
    const lane = laneOf(event);
    if (lane === 'oracle' || lane === 'expert' || event.state) seen.add(lane);
  }
  const last = ['oracle', 'expert'].filter((lane) => seen.has(lane));
  return [...seen].filter((lane) => !last.includes(lane)).concat(last);
}

/**
 * Of states, from start to end.
 * @param {server.TrialEvent[]} events
 * @param {number} end of the axis
 */
export function stateBars(events, end) {
  /** @type {replay.Bar[]} */
  const bars = [];
  /** @type {Map<string, number>} */
  const running = new Map(); // by lane, since when
  for (const { kind, path, state, t, words } of events) {
    const lane = path + '/' + state;
    const from = running.get(lane);
    if (kind === 'state_start') {
      // it failed while the robot was not well, and runs again
      if (from !== undefined) bars.push({ lane, from, to: t, kind: 'running', words });
      running.set(lane, t);
    }
    if (from === undefined || (kind !== 'failure' && kind !== 'transition')) continue;
    running.delete(lane);
    bars.push({ lane, from, to: t, kind: kind === 'failure' ? 'bad' : 'good', words });
  }
  for (const [lane, from] of running) {
    bars.push({ lane, from, to: end, kind: 'running', words: lane + ' runs' });
  }
  return bars;
}

/**
 * Of questions, from when they were asked.
 * @param {server.TrialEvent[]} events
 * @param {number} end of the axis
 */
export function questionBars(events, end) {
  /** @type {replay.Bar[]} */
  const bars = [];
  /** @type {server.TrialEvent | null} */
  let asked = null;
  /**
   * @param {server.TrialEvent} question
   * @param {number} to
   * @param {string} kind
   */
  const add = ({ t, words }, to, kind) => bars.push({ lane: 'expert', from: t, to, kind, words });
  for (const event of events) {
    if (event.kind === 'query_opened') asked = event;
    if (asked && ['query_answered', 'query_expired', 'query_cancelled'].includes(event.kind)) {
      add(asked, event.t, 'expert');
      asked = null;
    }
  }
  if (asked) add(asked, end, 'expert waiting');
  return bars;
}

/**
 * Round times of a part of the axis, s since its beginning.
 * @param {number} whole length of the part
 * @param {number} most
 * @param {number} [from] where the part begins
 */
export function ticks(whole, most, from = 0) {
  const step = STEPS_S.find((each) => whole / each <= Math.min(MOST_TICKS, most)) || whole / 5;
  const found = [];
  for (let number = Math.ceil(from / step); number * step <= from + whole; number += 1) {
    found.push(number * step);
  }
  return found;
}
