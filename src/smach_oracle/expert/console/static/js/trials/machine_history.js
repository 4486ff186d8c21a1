// @ts-check
// The state of a machine at a moment of a trial, derived from the trial's events alone. Pure.

/**
 * Events that are worth a stop: page keys go from one to the next.
 * @type {Set<server.EventName>}
 */
const LANDMARKS = new Set(['trial_start', 'failure', 'query_opened', 'query_answered', 'give_up',
  'supersede', 'trial_end']);
const CLOSED = { query_expired: 'nobody answered in time', query_cancelled: 'taken back' };
const DEEPEST = 50;

export class MachineHistory {
  constructor() {
    /** @type {server.TrialEvent[]} */
    this.events = [];
    this.index = -1; // of the last event that `now` knows of
    this.now = beginning();
  }

  /** @param {server.TrialEvent[]} events */
  set(events) {
    if (events.length < this.events.length || events[0] !== this.events[0]) this.clear();
    this.events = events;
  }

  clear() {
    this.index = -1;
    this.now = beginning();
  }

  get begin() { return this.events.length ? this.events[0].t : 0; }

  get end() { return this.events.length ? this.events[this.events.length - 1].t : 0; }

  /**
   * The last event at or before a time; -1 before the first.
   * @param {number} t
   */
  indexAt(t) {
    let [low, high] = [0, this.events.length];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.events[middle].t <= t) low = middle + 1;
      else high = middle;
    }
    return low - 1;
  }

  /**
   * The next event in a direction; -1 where there is none.
   * @param {number} index
   * @param {1 | -1} step
   * @param {boolean} landmarks of those that are worth a stop
   */
  next(index, step, landmarks) {
    for (let i = index + step; i >= 0 && i < this.events.length; i += step) {
      if (!landmarks || LANDMARKS.has(this.events[i].kind)) return i;
    }
    return -1;
  }

  /**
   * After the event of an index.
   * @param {number} index
   */
  at(index) {
    if (index < this.index) this.clear();
    while (this.index < Math.min(index, this.events.length - 1)) {
      this.index += 1;
      take(this.now, this.events[this.index]);
    }
    return this.now;
  }
}

/** @returns {replay.Snapshot} */
function beginning() {
  return { active: {}, asked: {}, latest: {}, failed: {}, rates: {}, taken: {}, failure: -1,
    question: null };
}

/**
 * @param {replay.Snapshot} now
 * @param {server.TrialEvent} event
 */
function take(now, event) {
  const { kind, path, state, target } = event;
  if (kind === 'trial_start') {
    Object.assign(now, { active: {}, asked: {}, latest: {}, failed: {}, failure: -1,
      question: null });
  } else if (kind === 'trial_end') {
    Object.assign(now, { active: {}, asked: {}, failed: {} });
  } else if (kind === 'state_start') {
    leaveOracle(now, path);
    now.active[path] = state;
  } else if (kind === 'transition') takeTransition(now, event);
  else if (kind === 'failure') takeFailure(now, event);
  else if (kind === 'jump') {
    count(now, path, null, target, target);
    now.latest[path] = ['', target];
    leaveOracle(now, path);
  } else if (kind === 'supersede' || kind === 'give_up') leaveOracle(now, path);
  else if (kind === 'container_end') {
    delete now.active[path];
    leaveOracle(now, path);
  } else if (kind.startsWith('query_') || kind.startsWith('interface_')) takeQuestion(now, event);
}

/**
 * @param {replay.Snapshot} now
 * @param {server.TrialEvent} event
 */
function takeTransition(now, { path, state, outcome, target, counted }) {
  count(now, path, state, outcome, target);
  // of one who is asked about it is the way to the oracle
  if (counted && !now.asked[path]) rateOf(now, path, state).successes += 1;
  now.latest[path] = [state, target];
  delete now.active[path];
}

/**
 * @param {replay.Snapshot} now
 * @param {server.TrialEvent} event
 */
function takeFailure(now, { seq, path, state, rate, class: rank }) {
  const learned = rateOf(now, path, state);
  learned.failures += 1;
  learned.rate = rate;
  learned.class = rank;
  now.failure = seq;
  now.question = null;
  now.failed[path] = { state };
  now.asked[path] = true;
  delete now.active[path];
}

/**
 * @param {replay.Snapshot} now
 * @param {server.TrialEvent} event
 */
function takeQuestion(now, event) {
  const { kind, query, state, text, by } = event;
  if (kind === 'query_opened') {
    now.question = { query, state, reason: text, holder: '', steps: [], answer: null, closed: '' };
  }
  const { question } = now;
  if (!question) return;
  if (kind === 'query_claimed') question.holder = by;
  else if (kind === 'query_released') question.holder = '';
  else if (kind === 'query_answered') {
    question.answer = { kind: event.outcome, target: event.target, by, why: text };
  } else if (kind === 'query_expired' || kind === 'query_cancelled') question.closed = CLOSED[kind];
  else if (kind.startsWith('interface_')) question.steps.push(event.words);
}

/**
 * @param {replay.Snapshot} now
 * @param {string} path
 */
function leaveOracle(now, path) {
  delete now.failed[path];
  delete now.asked[path];
}

/**
 * @param {replay.Snapshot} now
 * @param {string} path
 * @param {string | null} from null: the oracle
 * @param {string} outcome
 * @param {string} to
 */
function count(now, path, from, outcome, to) {
  const key = JSON.stringify([from, outcome, to]);
  const known = now.taken[path] || new Map();
  now.taken[path] = known;
  const times = (known.get(key)?.times || 0) + 1;
  known.set(key, { from, outcome, to, times });
}

/**
 * What is learned of a state, to be changed.
 * @param {replay.Snapshot} now
 * @param {string} path
 * @param {string} state
 */
function rateOf(now, path, state) {
  const rates = now.rates[path] || {};
  now.rates[path] = rates;
  const learned = rates[state] || { rate: null, class: 0, successes: 0, failures: 0 };
  rates[state] = learned;
  return learned;
}

/**
 * As machine_view.js shows it.
 * @param {replay.Snapshot} now
 * @param {string[]} paths
 * @param {(path: string) => string} oracleOf the label of a container's meta state
 * @returns {machine.MachineState}
 */
export function machineStateOf(now, paths, oracleOf) {
  /** @type {machine.MachineState['active']} */
  const active = {};
  for (const path of paths) {
    const label = now.active[path] || (now.asked[path] ? oracleOf(path) : '');
    active[path] = label ? [label] : [];
  }
  /** @type {machine.MachineState['counts']} */
  const counts = {};
  for (const path of Object.keys(now.taken)) counts[path] = countsOf(now, path, oracleOf(path));
  const { latest, failed, rates } = now;
  return { alive: true, active, latest, failed, rates, counts, paths };
}

/**
 * @param {replay.Snapshot} now
 * @param {string} path
 * @param {string} oracle
 * @returns {server.TransitionCount[]}
 */
function countsOf(now, path, oracle) {
  const taken = [...(now.taken[path] || new Map()).values()];
  /** @type {Map<string | null, number>} */
  const totals = new Map();
  for (const { from, times } of taken) totals.set(from, (totals.get(from) || 0) + times);
  return taken.map(({ from, outcome, to, times }) => (
    [from === null ? oracle : from, outcome, to, times, times / (totals.get(from) || times)]));
}

/**
 * From the top machine down to the state that runs or has failed: path of its container, and label.
 * @param {replay.Snapshot} now
 */
export function activePath(now) {
  /** @type {[path: string, label: string][]} */
  const found = [];
  const paths = Object.keys({ ...now.active, ...now.failed });
  let path = paths.sort((a, b) => a.length - b.length)[0];
  while (path && found.length <= DEEPEST) {
    const label = now.active[path] || now.failed[path]?.state;
    if (!label) break;
    found.push([path, label]);
    path = path + '/' + label;
  }
  return found;
}
