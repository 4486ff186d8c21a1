// @ts-check
// What a robot of the fleet is at, and how much it needs a person. Pure but for the store.
import { activeIn } from './focus_state.js';
import { isOracle, listed, resumable, running, waiting } from './hand_words.js';

/** @typedef {'waits' | 'held' | 'unwell' | 'silent' | 'asked' | 'paused' | 'runs' | 'idle'
 *   | 'gone'} Standing */
/** @typedef {{ state: string, path: string, rate: number | null }} ActivePlace */
/** @typedef {Pick<server.Question, 'key' | 'state' | 'stands' | 'asked' | 'rate' | 'holder'
 *   | 'interface'>} Asked what a card says of a question: few words, which are compared quickly */
/** @typedef {ReturnType<typeof factsOf>} RobotFacts */

const BY_NAME = new Intl.Collator('en', { numeric: true }); // robot_2 before robot_10
/** @type {Standing[]} by how much a person is needed */
const ORDER = ['waits', 'held', 'unwell', 'silent', 'asked', 'paused', 'runs', 'idle', 'gone'];

/** @param {RobotFacts} facts */
function needOf({ standing, health }) {
  const broken = health?.battery?.low || health?.problems.some(({ level }) => level === 'error');
  const place = ORDER.indexOf(standing);
  return broken && standing !== 'gone' ? Math.min(place, ORDER.indexOf('silent')) : place;
}

/**
 * Those that need a person first; among equals the longest question, then the name.
 * @param {RobotFacts[]} robots
 */
export function byNeed(robots) {
  return [...robots].sort((one, other) => needOf(one) - needOf(other)
    || (one.question?.asked || 0) - (other.question?.asked || 0)
    || BY_NAME.compare(one.robot, other.robot));
}

/**
 * Whether a person is needed.
 * @param {RobotFacts} facts
 */
export function needsHelp(facts) { return needOf(facts) <= ORDER.indexOf('silent'); }

/**
 * All robots: those that are followed, and those that only ask.
 * @param {page.App} app
 */
export function robotsOf({ store }) {
  const names = new Set([...(store.get('robots') || []), ...store.questions.map((q) => q.robot)]);
  return [...names].sort();
}

/**
 * What its card says of a robot.
 * @param {page.App} app
 * @param {string} robot
 */
export function factsOf(app, robot) {
  const { store } = app;
  const live = store.get(`live ${robot}`);
  const asked = store.questions.filter((each) => each.robot === robot);
  const waits = asked.filter(({ status, idle }) => status === 'pending' || idle > 0);
  const machines = live?.control || [];
  const { standing, why } = standingOf(app, robot, asked, waits);
  const [first] = [...waits, ...asked];
  return { robot, standing,
    why, // what makes it stand so, for a title
    question: first && shortened(first), // the one that has waited longest
    questions: asked.length,
    active: live && live.alive ? placesOf(live).filter((each) => !isOracle(each, robot, store))
      : [],
    path: live?.paths[0] || '', // of its first machine
    holdable: Boolean(live?.control), paused: machines.filter(({ paused }) => paused),
    health: store.get('health')?.[robot], last: live?.last || null };
}

/**
 * @param {server.Question} question
 * @returns {Asked}
 */
function shortened({ key, state, stands, asked, rate, holder, interface: name }) {
  return { key, state, stands, asked, rate, holder, interface: name };
}

/**
 * @param {page.App} app
 * @param {string} robot
 * @param {server.Question[]} asked
 * @param {server.Question[]} waits
 * @returns {{ standing: Standing, why: string }}
 */
function standingOf({ store, liveness }, robot, asked, waits) {
  const live = store.get(`live ${robot}`);
  const machines = live?.control || [];
  const held = machines.flatMap(waiting);
  const confirmed = held.filter(({ confirm }) => confirm);
  const breaks = held.filter(({ held: by }) => by === 'breakpoint');
  const pausers = machines.filter(({ paused }) => paused).map(({ by }) => by).filter(Boolean);
  if (live && !live.alive && !asked.length) return { standing: 'gone', why: '' };
  if (liveness.isSilent(robot)) return { standing: 'silent', why: '' };
  if (waits.length) return { standing: 'waits', why: waits[0].reason };
  if (confirmed.length) return { standing: 'held', why: listed(confirmed) };
  if (live?.unwell) return { standing: 'unwell', why: live.unwell };
  if (asked.length) return { standing: 'asked', why: asked[0].holder };
  if (machines.some(({ paused }) => paused) || breaks.length) {
    return { standing: 'paused', why: pausers.join(', ') || listed(breaks) };
  }
  const runs = live?.control ? machines.some((each) => each.running)
    : Boolean(live && placesOf(live).length);
  return { standing: runs ? 'runs' : 'idle', why: '' };
}

/**
 * The innermost states that run, with what was learned of them.
 * @param {server.LiveMachines} live
 * @returns {ActivePlace[]}
 */
function placesOf(live) {
  const places = live.control ? live.control.flatMap(running)
    : live.paths.flatMap((path) => activeIn(path, live)
      .filter((state) => state && state !== 'None' && !live.paths.includes(path + '/' + state))
      .map((state) => ({ path, state })));
  return places.map(({ path, state }) => (
    { path, state, rate: live.rates[path]?.[state]?.rate ?? null }));
}

/**
 * What will run once robots are resumed, in words.
 * @param {RobotFacts[]} robots
 */
export function resumedWords(robots) {
  return robots.map(({ robot, paused }) => (listed(paused.flatMap(resumable)) || 'what comes next')
    + (robots.length > 1 ? ' of ' + robot : '')).join(', ');
}
