// Trials: the counts of the paper's Table I, the list, and one trial on its time axis.
import { h, replace, setText } from './dom.js';
import { chip, clock, duration, percent } from './format.js';
import { Timeline } from './timeline.js';

export const trials = { id: 'trials', title: 'Trials', create: (app) => new Trials(app) };

const SHOWN_EVENTS = 600;
const ENDINGS = { success: 'good', failure: 'bad', preempted: 'warn', '': 'accent' };

class Trials {
  constructor(app) {
    this.app = app;
    this.chosen = '';
    this.events = [];
    this.table = h('div', { class: 'table-frame card' });
    this.list = h('div', { class: 'trial-list' });
    this.timeline = new Timeline((seq) => this.pick(seq));
    this.title = h('h2', {});
    this.facts = h('p', { class: 'dim' });
    this.log = h('ol', { class: 'event-log' });
    this.detail = h('section', { class: 'card trial-detail' }, this.title, this.facts, this.timeline.root, this.log);
    this.body = [this.table, h('div', { class: 'trial-body' }, this.list, this.detail)];
    this.empty = h('p', { class: 'empty' }, 'No trials yet. They appear as robots run; of what happened before this console was started, the bags tell.');
    this.root = h('div', { class: 'panel trials' }, this.empty);
    app.store.onEvents((message) => this.take(message));
  }

  shown() { this.update(['trials']); }

  connected() { if (this.chosen) this.watch(this.chosen); }

  choose(id) {
    this.follows = false;
    this.watch(id);
    this.update(['trials']);
  }

  // Ask for the events of a trial; they come from the first on, and then as they happen.
  watch(id) {
    this.chosen = id;
    this.events = [];
    this.logged = 0;
    replace(this.log);
    this.app.link.request('watch', { trial: id }).catch(() => {});
  }

  take(message) {
    if (message.trial !== this.chosen || message.from > this.events.length) return;
    this.events = this.events.slice(0, message.from).concat(message.events);
    this.showEvents();
  }

  update(names) {
    if (!names.includes('trials')) return;
    const data = this.app.store.get('trials');
    if (!data || !data.trials.length) {
      replace(this.root, this.empty);
      return;
    }
    if (!this.root.contains(this.list)) replace(this.root, this.body);
    if (this.app.current === 'trials') {
      const known = data.trials.some((trial) => trial.id === this.chosen);
      if (!known || (this.follows !== false && data.trials[0].id !== this.chosen)) {
        this.follows = true;
        this.watch(data.trials[0].id);
      }
    }
    this.showTable(data.table);
    this.showList(data.trials);
    this.showFacts(data.trials.find((trial) => trial.id === this.chosen));
  }

  showTable(table) {
    const key = JSON.stringify(table);
    if (key === this.tableKey) return;
    this.tableKey = key;
    this.table.hidden = !table.length;
    const share = (count, runs) => h('td', { class: 'number' }, count.trials, h('span', { class: 'dim' }, ' ' + percent(count.trials / runs)));
    replace(this.table, h('table', {}, h('caption', {}, 'Trials that ended while this console watched: in how many each happened at least once'),
      h('thead', {}, h('tr', {}, ['Experiment', 'Arm', 'Runs', 'Failures', 'Oracle recoveries', 'Questions', 'Expert interventions', 'Ended in failure'].map((title) => h('th', { scope: 'col' }, title)))),
      h('tbody', {}, table.map((row) => h('tr', {}, h('th', { scope: 'row' }, row.experiment), h('td', {}, row.oracle ? 'with oracle' : 'without oracle'), h('td', { class: 'number' }, row.runs),
        share(row.counts.failures, row.runs), share(row.counts.recoveries, row.runs), share(row.counts.questions, row.runs), share(row.counts.answered, row.runs),
        share({ trials: row.endings.failure }, row.runs))))));
  }

  showList(all) {
    const key = JSON.stringify([all, this.chosen]);
    if (key === this.listKey) return;
    this.listKey = key;
    replace(this.list, all.map((trial) => h('button', { class: 'trial', 'aria-current': trial.id === this.chosen, onclick: () => this.choose(trial.id), 'data-trial': trial.id },
      h('span', { class: 'row' }, h('strong', {}, trial.experiment), h('span', { class: 'spacer' }), chip(trial.outcome || trial.ending || 'running', ENDINGS[trial.ending])),
      h('span', { class: 'row dim' }, trial.robot, h('span', { class: 'spacer' }), clock(trial.start)),
      h('span', { class: 'dim' }, summary(trial)))));
  }

  showFacts(trial) {
    if (!trial) return;
    this.trial = trial;
    setText(this.title, trial.experiment + ' · ' + clock(trial.start));
    setText(this.facts, summary(trial) + (trial.lost ? ' · ' + trial.lost + ' events missing' : '') + (trial.detailed ? '' : ' · its events are no longer kept'));
    this.showEvents();
  }

  showEvents() {
    if (!this.trial || this.trial.id !== this.chosen || !this.events.length) return;
    const last = this.events[this.events.length - 1].t;
    this.timeline.set(this.events, this.trial.ending || this.trial.outcome ? last : Math.max(last, this.app.store.now()));
    const begin = this.events[0].t;
    const fresh = this.events.slice(this.logged);
    this.logged = this.events.length;
    for (const event of fresh) {
      this.log.prepend(h('li', { 'data-seq': event.seq, class: 'event ' + event.kind, onclick: () => this.pick(event.seq) },
        h('span', { class: 'number dim' }, '+' + (event.t - begin).toFixed(2) + ' s'), h('span', {}, event.words || event.kind,
          event.text && event.text !== event.words ? h('span', { class: 'dim' }, ' ' + event.text.slice(-300)) : null)));
    }
    while (this.log.childElementCount > SHOWN_EVENTS) this.log.lastElementChild.remove();
  }

  pick(seq) {
    this.timeline.pick(seq);
    for (const line of this.log.children) {
      const picked = Number(line.dataset.seq) === seq;
      line.classList.toggle('picked', picked);
      if (picked) line.scrollIntoView({ block: 'nearest' });
    }
  }

  tick() { if (this.trial && !this.trial.ending && !this.trial.outcome) this.showEvents(); }
}

function summary(trial) {
  const parts = [duration(trial.end - trial.start)];
  for (const [number, one, many] of [[trial.failures, 'failure', 'failures'], [trial.recoveries, 'recovery', 'recoveries'], [trial.questions, 'question', 'questions']]) {
    if (number) parts.push(number + ' ' + (number === 1 ? one : many));
  }
  return parts.join(' · ');
}
