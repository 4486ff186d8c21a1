// @ts-check
// Trials: the counts of the paper's Table I, the list, and one trial on its time axis, to be
// replayed.
import { h } from '../page/dom.js';
import { clock } from '../page/format.js';
import { keep, render } from '../page/redraw.js';
import { countsTable } from './counts_table.js';
import { EventLog } from './event_log.js';
import { RecordedTrials, bagNotes } from './recorded_trials.js';
import { TrialList, isOfBag, isRunning, summaryOf } from './trial_list.js';
import { TrialReplay } from './trial_replay.js';

/** @type {page.Panel} */
export const trials = { id: 'trials', title: 'Trials', create: (app) => new TrialPanel(app) };

const NARROW = '(max-width: 960px)';
const NO_TRIALS = 'No trial runs. Trials appear as robots run. Those that ended before this '
  + 'console was started are in the bags.';
const COUNTED = ': in how many each happened at least once';
const HEARD = 'Trials that ended while this console watched' + COUNTED;
const IN_BAGS = 'Trials in the bags' + COUNTED;

/** @param {server.Trial} trial */
function lostEvents(trial) {
  const { lost } = trial;
  return isOfBag(trial) ? lost + ' events missing' : lost + ' events were not heard';
}

class TrialPanel {
  /** @param {page.App} app */
  constructor(app) {
    this.app = app;
    this.chosen = ''; // id of the trial that is shown
    /** @type {server.Trial | null} */
    this.bag = null; // the trial that is shown, if it is one of a bag
    /** @type {server.Trial | null} */
    this.trial = null;
    this.wanted = ''; // id of the trial that an address names, until it is found
    this.follows = true; // the newest trial is shown, until a person chooses
    /** @type {server.TrialEvent[]} */
    this.events = [];
    this.list = new TrialList((id) => this.choose(id), () => this.draw());
    this.replay = new TrialReplay(app, (event) => this.log.mark(event.seq));
    this.recorded = new RecordedTrials(app, () => this.showRecorded());
    this.log = new EventLog((seq) => this.replay.pick(seq));
    // what comes and goes with a failure is last: nothing slips away from under a finger
    this.replay.root.append(h('div', { class: 'replay-below' }, this.replay.stage, this.log.root),
      this.replay.lastSeconds.root);
    this.root = h('div', {});
    app.store.onEvents((slice) => this.take(slice));
  }

  get isCurrent() { return this.app.current === 'trials'; }

  get place() { return this.follows ? '' : this.chosen; }

  /** @param {string} id of a trial, '' for the newest */
  goTo(id) {
    this.wanted = id;
    if (!id) this.follows = true;
    this.draw();
  }

  connected() { if (this.chosen && !this.bag) this.watch(this.chosen); }

  /** @param {string} id */
  choose(id) {
    this.follows = false;
    this.wanted = '';
    const trial = this.all.find((each) => each.id === id);
    if (trial) this.open(trial);
    else this.watch(id);
    this.draw();
    this.app.went();
    if (matchMedia(NARROW).matches) this.replay.root.parentElement?.scrollIntoView();
  }

  /** @param {server.Trial} trial */
  open(trial) {
    if (trial.number === undefined) {
      this.watch(trial.id);
      return;
    }
    this.begin(trial.id, trial);
    this.recorded.open(trial.number);
  }

  /**
   * @param {string} id
   * @param {server.Trial | null} bag
   */
  begin(id, bag) {
    this.chosen = id;
    this.bag = bag;
    this.events = [];
    this.log.clear();
  }

  /**
   * Ask for the events of a trial; they come from the first on, and then as they happen.
   * @param {string} id
   */
  watch(id) {
    this.begin(id, null);
    this.app.connection.request('watch', { trial: id }).catch(() => {});
  }

  showRecorded() {
    const { opened } = this.recorded;
    if (opened && opened.number === this.bag?.number) this.events = opened.events;
    this.draw();
  }

  /** @param {server.EventSlice} slice */
  take({ trial, from, events }) {
    if (this.bag || trial !== this.chosen || from > this.events.length) return;
    this.events = this.events.slice(0, from).concat(events);
    if (this.isCurrent) this.showEvents();
  }

  /** Those that the server has heard of, then those in bags that it has not, newest first. */
  get all() {
    const heard = this.app.store.get('trials')?.trials || [];
    const ids = new Set(heard.map((trial) => trial.id));
    return heard.concat(this.recorded.overview.trials.filter((trial) => !ids.has(trial.id)));
  }

  get sections() { return /^(?:trials|bags|graph .*)$/; }

  /** @param {string[]} [names] of sections that have changed */
  draw(names) {
    if (!this.isCurrent) return; // it is drawn as it comes
    const { all } = this;
    if (!this.bag && names?.some((name) => name.startsWith('graph '))) this.replay.redraw();
    if (all.length) this.settle(all);
    this.trial = all.find((each) => each.id === this.chosen) || this.trial;
    this.list.show(all, this.chosen);
    render(this.root, h('div', { class: 'panel trials' }, this.view(all.length)));
    this.showEvents();
  }

  /** @param {number} count of trials */
  view(count) {
    const { trial, recorded } = this;
    const { table: bags } = recorded.overview;
    const notes = bagNotes(recorded.overview);
    if (!count && !notes.length) return h('p', { key: 'none', class: 'empty' }, NO_TRIALS);
    const heard = this.app.store.get('trials')?.table || [];
    return [h('div', { class: 'table-frame card trial-counts',
      hidden: !heard.length && !bags.length },
    heard.length > 0 && countsTable(HEARD, heard), bags.length > 0 && countsTable(IN_BAGS, bags)),
    h('div', { class: 'bag-notes', hidden: !notes.length }, notes),
    h('div', { class: 'trial-body' }, keep(this.list.root),
      h('section', { class: 'card trial-detail' },
        h('div', {}, h('h2', {}, trial && `${trial.experiment} · ${clock(trial.start)}`),
          h('p', { class: 'dim' }, trial && this.factsOf(trial)),
          h('p', { class: 'problem', role: 'alert' }, this.bag && recorded.problem)),
        keep(this.replay.root)))];
  }

  /**
   * Turn to the newest trial where the chosen one is gone, or none was chosen.
   * @param {server.Trial[]} all
   */
  settle(all) {
    const named = all.find(({ id }) => id === this.wanted);
    if (named) {
      this.wanted = '';
      this.follows = false;
      if (named.id !== this.chosen) this.open(named);
      return;
    }
    const newest = all[0];
    const gone = !all.some((trial) => trial.id === this.chosen);
    const newer = this.follows && !isOfBag(newest) && newest.id !== this.chosen;
    if (!gone && !newer) return;
    this.follows = true;
    this.open(newest);
  }

  /** @param {server.Trial} trial */
  factsOf(trial) {
    const { lost, nth, detailed, bag } = trial;
    return [summaryOf(trial, this.app.store.now()), nth && `trial ${nth} of its program`,
      lost && lostEvents(trial), !detailed && 'its events are no longer kept', bag]
      .filter(Boolean).join(' · ');
  }

  showEvents() {
    const { trial, events } = this;
    if (!trial || trial.id !== this.chosen) return;
    this.replay.root.hidden = !events.length;
    if (!events.length) return;
    this.log.show(() => this.events);
    const last = events[events.length - 1].t;
    const running = !this.bag && isRunning(trial);
    this.replay.set({ id: this.chosen, events, running, ...this.recording(trial),
      end: running ? Math.max(last, this.app.store.now()) : last });
  }

  /**
   * What is beside the events of a trial.
   * @param {server.Trial} trial
   * @returns {Pick<replay.ReplayedTrial, 'graph' | 'images' | 'replays'>}
   */
  recording({ robot }) {
    const { store } = this.app;
    const { opened } = this.recorded;
    if (!this.bag || !opened) {
      return { graph: (path) => store.get(`graph ${robot} ${path}`), images: {}, replays: {} };
    }
    const { images, replays } = opened;
    return { graph: (path) => opened.graphs[path], images, replays };
  }
}
