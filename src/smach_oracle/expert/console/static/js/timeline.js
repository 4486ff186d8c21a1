// A trial on a time axis: a lane for each state, one for the oracle, one for the expert.
import { h, replace, s } from './dom.js';
import { duration } from './format.js';

const LANE = 26;
const NAME = 168;
const TOP = 26;
const MARKS = { failure: 'bad', decision: 'oracle', jump: 'oracle', supersede: 'expert', give_up: 'bad', warning: 'warn',
  query_opened: 'expert', query_claimed: 'expert', query_answered: 'expert', query_expired: 'bad', interface_start: 'expert', interface_end: 'expert',
  precondition_start: 'oracle', precondition_end: 'oracle', preempt: 'warn' };

export class Timeline {
  constructor(onPick) {
    this.onPick = onPick;
    this.root = h('div', { class: 'timeline' });
    new ResizeObserver(() => this.draw()).observe(this.root);
  }

  set(events, end) {
    this.events = events;
    this.end = end;
    this.draw();
  }

  pick(seq) {
    this.picked = seq;
    for (const mark of this.root.querySelectorAll('[data-seq]')) mark.classList.toggle('picked', Number(mark.dataset.seq) === seq);
  }

  draw() {
    const width = this.root.clientWidth;
    if (!this.events || !this.events.length || width < 50) {
      replace(this.root, h('p', { class: 'empty' }, 'No events.'));
      return;
    }
    const { lanes, bars } = spans(this.events, this.end);
    const name = Math.min(NAME, width * 0.3);
    const begin = this.events[0].t;
    const whole = Math.max(this.end - begin, 0.001);
    const x = (t) => name + (width - name - 14) * Math.min(1, Math.max(0, (t - begin) / whole));
    const height = TOP + lanes.length * LANE + 6;
    const y = (lane) => TOP + lanes.indexOf(lane) * LANE;
    replace(this.root, s('svg', { width, height, viewBox: '0 0 ' + width + ' ' + height, role: 'img', 'aria-label': 'Events of the trial over time' },
      ticks(whole).map((tick) => [s('line', { class: 'tick', x1: x(begin + tick), x2: x(begin + tick), y1: TOP - 6, y2: height }),
        s('text', { class: 'tick-text', x: x(begin + tick), y: 14 }, tick < 10 ? Math.round(tick * 100) / 100 + ' s' : duration(tick))]),
      lanes.map((lane) => s('text', { class: 'lane', x: 0, y: y(lane) + 16 }, short(lane, name), s('title', {}, lane))),
      bars.map((bar) => s('rect', { class: 'bar ' + bar.kind, x: x(bar.from), y: y(bar.lane) + 4, rx: 3, height: LANE - 8,
        width: Math.max(2, x(bar.to) - x(bar.from)) }, s('title', {}, bar.words))),
      this.events.filter((event) => MARKS[event.kind]).map((event) => s('circle', {
        class: 'mark ' + MARKS[event.kind] + (event.seq === this.picked ? ' picked' : ''), cx: x(event.t), cy: y(laneOf(event)) + LANE / 2, r: 4.5,
        'data-seq': event.seq, onclick: () => this.onPick(event.seq) }, s('title', {}, event.words)))));
  }
}

function short(lane, width) {
  const most = Math.floor((width - 8) / 7.7);
  const label = lane.split('/').pop();
  return label.length > most ? label.slice(0, most - 1) + '…' : label;
}

function laneOf(event) {
  if (event.kind.startsWith('query') || event.kind.startsWith('interface') || event.kind === 'supersede') return 'expert';
  if (MARKS[event.kind] === 'oracle' || event.kind === 'give_up') return 'oracle';
  return event.state ? event.path + '/' + event.state : 'oracle';
}

// Lanes in the order of their first event, expert and oracle at the end; bars from a state's start to its end.
function spans(events, end) {
  const lanes = [];
  const bars = [];
  const open = new Map();
  let asked = null;
  const failed = new Set();
  const close = (lane, t, kind, words) => {
    const from = open.get(lane);
    open.delete(lane);
    if (from !== undefined) bars.push({ lane, from, to: t, kind, words });
  };
  const seen = { oracle: false, expert: false };
  for (const event of events) {
    const lane = laneOf(event);
    if (lane in seen) seen[lane] = true;
    else if (event.state && !lanes.includes(lane)) lanes.push(lane);
    const state = event.path + '/' + event.state;
    if (event.kind === 'state_start') { open.set(state, event.t); failed.delete(state); }
    if (event.kind === 'failure') { close(state, event.t, 'bad', event.words); failed.add(state); }
    if (event.kind === 'transition') close(state, event.t, 'good', event.words);
    if (event.kind === 'query_opened') asked = event;
    if (asked && ['query_answered', 'query_expired', 'query_cancelled'].includes(event.kind)) {
      bars.push({ lane: 'expert', from: asked.t, to: event.t, kind: 'expert', words: asked.words });
      asked = null;
    }
  }
  for (const [lane, from] of open) bars.push({ lane, from, to: end, kind: 'running', words: lane + ' runs' });
  if (asked) bars.push({ lane: 'expert', from: asked.t, to: end, kind: 'expert waiting', words: asked.words });
  return { lanes: lanes.concat(seen.oracle ? ['oracle'] : [], seen.expert ? ['expert'] : []), bars };
}

function ticks(whole) {
  const step = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1800, 3600].find((each) => whole / each <= 7) || whole / 5;
  const found = [];
  for (let tick = 0; tick <= whole; tick += step) found.push(tick);
  return found;
}
