// What a machine was doing at a moment of a trial, told from its events alone. Pure.

// Events that are worth a stop: page keys go from one to the next.
const LANDMARKS = new Set(['trial_start', 'failure', 'query_opened', 'query_answered', 'give_up', 'supersede', 'trial_end']);
const CLOSED = { query_expired: 'nobody answered in time', query_cancelled: 'taken back' };

export class Course {
  constructor() {
    this.events = [];
    this.clear();
  }

  set(events) {
    if (events.length < this.events.length || events[0] !== this.events[0]) this.clear();
    this.events = events;
  }

  clear() {
    this.index = -1;
    this.now = { active: {}, asked: {}, latest: {}, failed: {}, rates: {}, taken: {}, question: null };
  }

  get begin() { return this.events.length ? this.events[0].t : 0; }

  get end() { return this.events.length ? this.events[this.events.length - 1].t : 0; }

  // The last event at or before a time; -1 before the first.
  indexAt(t) {
    let [low, high] = [0, this.events.length];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.events[middle].t <= t) low = middle + 1;
      else high = middle;
    }
    return low - 1;
  }

  // The next event in a direction; `landmarks`: of those that are worth a stop. -1 where there is none.
  next(index, step, landmarks) {
    for (let i = index + step; i >= 0 && i < this.events.length; i += step) {
      if (!landmarks || LANDMARKS.has(this.events[i].kind)) return i;
    }
    return -1;
  }

  // How things stand after the event of an index.
  at(index) {
    if (index < this.index) this.clear();
    while (this.index < Math.min(index, this.events.length - 1)) this.take(this.events[++this.index]);
    return this.now;
  }

  take(event) {
    const { now } = this;
    const { kind, path, state, target } = event;
    if (kind === 'trial_start') {
      this.now = Object.assign(now, { active: {}, asked: {}, latest: {}, failed: {}, question: null });
    } else if (kind === 'state_start') {
      now.active[path] = state;
      this.leave(path);
    } else if (kind === 'transition') {
      this.count(path, state, event.outcome, target);
      if (!now.asked[path]) this.learn(path, state, { good: 1 }); // else it is the way to the oracle
      now.latest[path] = [state, target];
      delete now.active[path];
    } else if (kind === 'failure') {
      this.learn(path, state, { bad: 1, rate: event.rate, class: event.class });
      Object.assign(now, { question: null });
      now.failed[path] = { state, rate: event.rate };
      now.asked[path] = true;
      delete now.active[path];
    } else if (kind === 'jump') {
      this.count(path, null, target, target);
      now.latest[path] = ['', target];
      this.leave(path);
    } else if (kind === 'supersede' || kind === 'give_up') {
      this.leave(path);
    } else if (kind === 'container_end') {
      delete now.active[path];
      this.leave(path);
    } else if (kind === 'trial_end') {
      Object.assign(now, { active: {}, asked: {}, failed: {} });
    } else if (kind.startsWith('query_') || kind.startsWith('interface_')) {
      this.ask(event);
    }
  }

  leave(path) {
    delete this.now.failed[path];
    delete this.now.asked[path];
  }

  ask(event) {
    const { now } = this;
    if (event.kind === 'query_opened') now.question = { query: event.query, path: event.path, state: event.state, reason: event.text, holder: '', steps: [], answer: null };
    const { question } = now;
    if (!question) return;
    if (event.kind === 'query_claimed') question.holder = event.by;
    else if (event.kind === 'query_released') question.holder = '';
    else if (event.kind === 'query_answered') question.answer = { kind: event.outcome, target: event.target, by: event.by, why: event.text };
    else if (event.kind in CLOSED) question.closed = CLOSED[event.kind];
    else if (event.kind.startsWith('interface_')) question.steps.push(event.words);
  }

  // `from` null: the oracle, whose label the graph knows.
  count(path, from, outcome, to) {
    const key = JSON.stringify([from, outcome, to]);
    const taken = this.now.taken[path] || (this.now.taken[path] = new Map());
    taken.set(key, (taken.get(key) || 0) + 1);
  }

  learn(path, state, { good = 0, bad = 0, rate = null, class: rank = 0 }) {
    const rates = this.now.rates[path] || (this.now.rates[path] = {});
    const before = rates[state] || { rate: null, class: 0, successes: 0, failures: 0 };
    rates[state] = { rate: bad ? rate : before.rate, class: bad ? rank : before.class, successes: before.successes + good, failures: before.failures + bad };
  }
}

// What `machines.js` draws: as the section `live` of a robot, for a moment of the past. `oracleOf(path)`: the label of a
// container's meta state.
export function liveAt(now, paths, oracleOf) {
  const active = {};
  for (const path of paths) active[path] = now.active[path] ? [now.active[path]] : now.asked[path] ? [oracleOf(path)] : [];
  const counts = {};
  for (const [path, taken] of Object.entries(now.taken)) {
    const rows = [...taken].map(([key, times]) => [...JSON.parse(key).map((label) => (label === null ? oracleOf(path) : label)), times]);
    const totals = {};
    for (const [from, , , times] of rows) totals[from] = (totals[from] || 0) + times;
    counts[path] = rows.map(([from, outcome, to, times]) => [from, outcome, to, times, times / totals[from]]);
  }
  return { alive: true, active, latest: now.latest, failed: now.failed, rates: now.rates, counts, paths };
}

// From the top machine down to the state that runs or has failed: [path, label] each.
export function activePath(now) {
  const found = [];
  for (let path = Object.keys({ ...now.active, ...now.failed }).sort((a, b) => a.length - b.length)[0]; path;) {
    const label = now.active[path] || (now.failed[path] || {}).state;
    if (!label || found.length > 50) break;
    found.push([path, label]);
    path = path + '/' + label;
  }
  return found;
}
