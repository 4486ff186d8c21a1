// Trials: the counts of the paper's Table I, the list, and one trial on its time axis, to be replayed.
import { h, redraw, replace, setText, whenLetGo } from './dom.js';
import { added, chip, clock, duration, percent } from './format.js';
import { Recorded } from './recorded.js';
import { Replay } from './replay.js';

export const trials = { id: 'trials', title: 'Trials', create: (app) => new Trials(app) };

const SHOWN_EVENTS = 600;
const ENDINGS = { success: 'good', failure: 'bad', preempted: 'warn', unfinished: 'warn', '': 'accent' };
const FILTERS = { all: ['All trials', () => true], failed: ['With failures', (trial) => trial.failures > 0], asked: ['With questions', (trial) => trial.questions > 0],
  bad: ['Not ended well', (trial) => trial.ending && trial.ending !== 'success'] };
const COLUMNS = ['Experiment', 'Arm', 'Runs', 'Failures', 'Oracle recoveries', 'Questions', 'Expert interventions', 'Ended in failure'];

class Trials {
  constructor(app) {
    this.app = app;
    this.chosen = '';
    this.events = [];
    this.table = h('div', { class: 'table-frame card trial-counts' });
    this.list = h('div', { class: 'trial-list', role: 'group', 'aria-label': 'Trials' });
    this.filter = h('select', { class: 'trial-filter', 'aria-label': 'Which trials are listed', onchange: () => this.update(['trials']) }, Object.entries(FILTERS).map(([name, [title]]) => h('option', { value: name }, title)));
    this.replay = new Replay(app, (event) => this.mark(event.seq));
    this.recorded = new Recorded(app, () => this.showRecorded());
    this.title = h('h2', {});
    this.facts = h('p', { class: 'dim' });
    this.problem = h('p', { class: 'problem', role: 'alert' });
    this.log = h('ol', { class: 'event-log', 'aria-label': 'Events, newest first' });
    this.detail = h('section', { class: 'card trial-detail' }, h('div', {}, this.title, this.facts, this.problem), this.replay.root);
    this.replay.root.append(h('div', { class: 'replay-below' }, this.replay.stage, this.log));
    this.body = [this.table, this.recorded.root, h('div', { class: 'trial-body' }, h('div', { class: 'trial-side' }, this.filter, this.list), this.detail)];
    this.empty = h('p', { class: 'empty' }, 'No trials yet. They appear as robots run; of what happened before this console was started, the bags tell.');
    this.root = h('div', { class: 'panel trials' }, this.empty);
    app.store.onEvents((message) => this.take(message));
  }

  shown() { this.update(['trials', 'bags']); }

  connected() { if (this.chosen && !this.bag) this.watch(this.chosen); }

  choose(id) {
    this.follows = false;
    const trial = this.find(id);
    if (trial && trial.number !== undefined) this.watchRecorded(trial);
    else this.watch(id);
    this.update(['trials']);
    if (matchMedia('(max-width: 760px)').matches) this.detail.scrollIntoView();
  }

  begin(id, bag) {
    this.chosen = id;
    this.bag = bag;
    this.events = [];
    this.logged = 0;
    setText(this.problem, '');
    replace(this.log);
  }

  // Ask for the events of a trial; they come from the first on, and then as they happen.
  watch(id) {
    this.begin(id, null);
    this.app.link.request('watch', { trial: id }).catch(() => {});
  }

  watchRecorded(trial) {
    this.begin(trial.id, trial);
    this.recorded.open(trial.number);
  }

  showRecorded() {
    const { opened, problem } = this.recorded;
    setText(this.problem, this.bag ? problem : '');
    if (!this.bag || !opened || opened.number !== this.bag.number) return;
    this.events = opened.events;
    this.showEvents();
  }

  take(message) {
    if (this.bag || message.trial !== this.chosen || message.from > this.events.length) return;
    this.events = this.events.slice(0, message.from).concat(message.events);
    this.showEvents();
  }

  // Those that this console has heard of, then those in bags that it has not, newest first.
  get all() {
    const live = (this.app.store.get('trials') || { trials: [] }).trials;
    const heard = new Set(live.map((trial) => trial.id));
    return live.concat(this.recorded.trials.filter((trial) => !heard.has(trial.id)));
  }

  find(id) { return this.all.find((trial) => trial.id === id); }

  update(names) {
    if (names.some((name) => name.startsWith('graph ')) && !this.bag && this.app.current === 'trials') this.replay.redraw();
    if (!names.includes('trials') && !names.includes('bags')) return;
    this.recorded.update();
    const all = this.all;
    if (!all.length && !this.recorded.says) {
      replace(this.root, this.empty);
      return;
    }
    if (!this.root.contains(this.list)) replace(this.root, this.body);
    if (this.app.current === 'trials' && all.length) {
      const newest = all[0];
      if (!all.some((trial) => trial.id === this.chosen) || (this.follows !== false && newest.number === undefined && newest.id !== this.chosen)) {
        this.follows = true;
        if (newest.number === undefined) this.watch(newest.id);
        else this.watchRecorded(newest);
      }
    }
    this.showTable();
    this.showList(all);
    this.showFacts(all.find((trial) => trial.id === this.chosen));
  }

  showTable() {
    const live = (this.app.store.get('trials') || {}).table || [];
    const bags = this.recorded.table;
    const key = JSON.stringify([live, bags]);
    if (key === this.tableKey) return;
    this.tableKey = key;
    this.table.hidden = !live.length && !bags.length;
    redraw(this.table, live.length > 0 && counted('Trials that ended while this console watched: in how many each happened at least once', live),
      bags.length > 0 && counted('Trials in the bags: in how many each happened at least once', bags));
  }

  showList(all) {
    const key = JSON.stringify([all, this.chosen, this.filter.value]);
    if (key === this.listKey) return;
    this.listKey = key;
    const row = (trial) => h('button', { key: trial.id, class: 'trial', 'aria-current': trial.id === this.chosen, onclick: () => this.choose(trial.id), 'data-trial': trial.id, 'data-number': trial.number },
      h('span', { class: 'row' }, h('strong', { class: 'ellipsis' }, trial.experiment), h('span', { class: 'spacer' }), chip(trial.outcome || trial.ending || 'running', ENDINGS[trial.ending])),
      h('span', { class: 'row dim' }, h('span', { class: 'ellipsis' }, trial.robot), h('span', { class: 'spacer' }), clock(trial.start)),
      h('span', { class: 'dim' }, summary(trial)));
    const wanted = all.filter(FILTERS[this.filter.value][1]);
    const old = wanted.filter((trial) => trial.number !== undefined);
    const live = wanted.filter((trial) => trial.number === undefined);
    let day = '';
    redraw(this.list, live.map(row), old.map((trial) => {
      const date = new Date(trial.start * 1000).toLocaleDateString();
      const heading = date !== day && h('h4', { class: 'trial-day' }, 'Bags of ', date);
      day = date;
      return [heading, row(trial)];
    }), !wanted.length && h('p', { class: 'dim' }, 'None.'));
  }

  showFacts(trial) {
    if (!trial) return;
    this.trial = trial;
    setText(this.title, trial.experiment + ' · ' + clock(trial.start));
    setText(this.facts, summary(trial, this.app.store.now()) + (trial.lost ? ' · ' + trial.lost + ' events missing' : '') + (trial.detailed ? '' : ' · its events are no longer kept') + (trial.bag ? ' · ' + trial.bag : ''));
    this.showEvents();
  }

  showEvents() {
    if (!this.trial || this.trial.id !== this.chosen || this.app.current !== 'trials') return;
    this.replay.root.hidden = !this.events.length;
    if (!this.events.length) return;
    const last = this.events[this.events.length - 1].t;
    const running = !this.bag && runs(this.trial);
    whenLetGo(this.log, () => this.showLog());
    const { robot } = this.trial;
    this.replay.set(this.chosen, this.events, running ? Math.max(last, this.app.store.now()) : last,
      this.bag ? (path) => this.recorded.opened.graphs[path] : (path) => this.app.store.get('graph ' + robot + ' ' + path), running, this.bag && this.recorded.opened.stills);
  }

  showLog() {
    const fresh = this.events.slice(this.logged);
    this.logged = this.events.length;
    for (const event of fresh) {
      this.log.prepend(h('li', { 'data-seq': event.seq, class: 'event ' + event.kind, onclick: () => this.replay.pick(event.seq) },
        h('span', { class: 'number dim' }, '+' + (event.t - this.events[0].t).toFixed(2) + ' s'), h('span', {}, event.words || event.kind, h('span', { class: 'dim' }, added(event)))));
    }
    while (this.log.childElementCount > SHOWN_EVENTS) this.log.lastElementChild.remove();
  }

  // The event under the cursor, in the log.
  mark(seq) {
    if (this.marked) this.marked.classList.remove('picked');
    this.marked = this.log.querySelector('[data-seq="' + Number(seq) + '"]');
    if (!this.marked) return;
    this.marked.classList.add('picked');
    const top = this.marked.offsetTop - this.log.offsetTop;
    if (top < this.log.scrollTop || top + this.marked.offsetHeight > this.log.scrollTop + this.log.clientHeight) this.log.scrollTop = top - this.log.clientHeight / 2;
  }

  tick() { if (this.trial && !this.bag && runs(this.trial)) this.showFacts(this.trial); }
}

function counted(caption, table) {
  const share = (count, runs) => h('td', { class: 'number' }, count.trials, h('span', { class: 'dim' }, ' ' + percent(count.trials / runs)));
  return h('table', {}, h('caption', {}, caption), h('thead', {}, h('tr', {}, COLUMNS.map((title) => h('th', { scope: 'col' }, title)))),
    h('tbody', {}, table.map((row) => h('tr', {}, h('th', { scope: 'row' }, row.experiment), h('td', {}, row.arm || (row.oracle ? 'with oracle' : 'without oracle')), h('td', { class: 'number' }, row.runs),
      share(row.counts.failures, row.runs), share(row.counts.recoveries, row.runs), share(row.counts.questions, row.runs), share(row.counts.answered, row.runs),
      share({ trials: row.endings.failure }, row.runs)))));
}

function runs(trial) { return trial.number === undefined && !trial.ending && !trial.outcome; }

// `now`: by the server's clock; without it nothing is said of how long a trial has run that has not ended.
function summary(trial, now) {
  const parts = runs(trial) ? [now && duration(now - trial.start)].filter(Boolean) : [duration(trial.end - trial.start)];
  for (const [number, one, many] of [[trial.failures, 'failure', 'failures'], [trial.recoveries, 'recovery', 'recoveries'], [trial.questions, 'question', 'questions']]) {
    if (number) parts.push(number + ' ' + (number === 1 ? one : many));
  }
  return parts.join(' · ') || 'no failure yet';
}
