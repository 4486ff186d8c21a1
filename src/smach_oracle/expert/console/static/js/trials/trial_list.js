// @ts-check
// The trials to choose from: those that this server has heard of, then those of bags, by days.
import { h, pick } from '../page/dom.js';
import { chip, clock, counted, duration } from '../page/format.js';
import { redrawWith } from '../page/redraw.js';

/** @type {{ [ending in server.Trial['ending']]: string }} */
const ENDINGS = { success: 'good', failure: 'bad', other: 'warn', preempted: 'warn',
  unfinished: 'warn', '': 'accent' };
/** @typedef {{ title: string, fits: (trial: server.Trial) => boolean }} TrialFilter */
/** @type {{ [name: string]: TrialFilter | undefined }} */
const FILTERS = {
  all: { title: 'All trials', fits: () => true },
  failed: { title: 'With failures', fits: (trial) => trial.failures > 0 },
  asked: { title: 'With questions', fits: (trial) => trial.questions > 0 },
  bad: { title: 'Not ended well',
    fits: ({ ending }) => Boolean(ending) && ending !== 'success' },
};

/** @param {server.Trial} trial */
export function isOfBag(trial) { return trial.number !== undefined; }

/** @param {server.Trial} trial */
export function isRunning(trial) { return !isOfBag(trial) && !trial.ending && !trial.outcome; }

/**
 * How long it took, and what happened in it.
 * @param {server.Trial} trial
 * @param {number} [now] by the server's clock; without it nothing is said of how long a trial has
 *   run that has not ended
 */
export function summaryOf(trial, now) {
  const { start, end, failures, recoveries, questions } = trial;
  const until = isRunning(trial) ? now : end;
  return [
    until !== undefined && duration(until - start),
    failures && counted(failures, 'failure'),
    recoveries && counted(recoveries, 'recovery', 'recoveries'),
    questions && counted(questions, 'question'),
  ].filter(Boolean).join(' · ') || 'no failure yet';
}

export class TrialList {
  /**
   * @param {(id: string) => void} onChoose
   * @param {() => void} onFilter another choice of trials is wanted
   */
  constructor(onChoose, onFilter) {
    this.onChoose = onChoose;
    this.list = h('div', { class: 'trial-list', role: 'group', 'aria-label': 'Trials' });
    this.filter = pick({ class: 'trial-filter', 'aria-label': 'Which trials are listed' },
      Object.entries(FILTERS).map(([name, filter]) => [name, filter?.title]), 'all', onFilter);
    this.root = h('div', { class: 'trial-side' }, this.filter, this.list);
  }

  /**
   * @param {server.Trial[]} all
   * @param {string} chosen
   */
  show(all, chosen) {
    redrawWith(this.list, [all, chosen, this.filter.value], () => {
      const wanted = all.filter((trial) => FILTERS[this.filter.value]?.fits(trial));
      const heard = wanted.filter((trial) => !isOfBag(trial));
      const days = groupedByDay(wanted.filter(isOfBag));
      return [heard.map((trial) => this.row(trial, chosen)),
        days.map(({ day, trials }) => [h('h2', { class: 'trial-day' }, 'Bags of ', day),
          trials.map((trial) => this.row(trial, chosen))]),
        !wanted.length && h('p', { class: 'dim' }, 'None.')];
    });
  }

  /**
   * @param {server.Trial} trial
   * @param {string} chosen
   */
  row(trial, chosen) {
    const { id, number, experiment, outcome, ending, robot, start } = trial;
    return h('button', { key: id, class: 'trial', 'aria-current': id === chosen,
      onclick: () => this.onChoose(id), 'data-trial': id, 'data-number': number },
    h('span', { class: 'row' }, h('strong', { class: 'ellipsis' }, experiment),
      h('span', { class: 'spacer' }), chip(outcome || ending || 'running', ENDINGS[ending])),
    h('span', { class: 'row dim' }, h('span', { class: 'ellipsis' }, robot),
      h('span', { class: 'spacer' }), clock(start)),
    h('span', { class: 'dim' }, summaryOf(trial)));
  }
}

/**
 * @param {server.Trial[]} trials newest first
 */
function groupedByDay(trials) {
  /** @type {{ day: string, trials: server.Trial[] }[]} */
  const found = [];
  for (const trial of trials) {
    const day = new Date(trial.start * 1000).toLocaleDateString();
    const last = found[found.length - 1];
    if (last && last.day === day) last.trials.push(trial);
    else found.push({ day, trials: [trial] });
  }
  return found;
}
