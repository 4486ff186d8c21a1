// @ts-check
// How old the last word of the console, the master and the robots is, and what is too old for an
// answer. The console sends a beat every second; the ages that come with it grow until the next.
import { duration } from './format.js';

/** @typedef {'' | 'console' | 'master'} Silent */

const SILENT_AFTER_S = 6; // the console has the same limit (last_heard.py)

export class Liveness {
  /** @param {page.Store} store */
  constructor(store) {
    this.store = store;
    this.running = performance.now(); // of the last beat, by both clocks
    this.wall = Date.now();
    store.onChange((names) => { if (names.includes('heard')) this.begin(); });
  }

  /** A beat has come, or a connection begins. */
  begin() {
    this.running = performance.now();
    this.wall = Date.now();
  }

  /** @returns {server.Heard | undefined} */
  get heard() { return this.store.get('heard'); }

  /** The newest beat, for what is sent to say what the page has seen. */
  get beat() { return this.heard?.beat; }

  /**
   * Since the console's last word. A machine that sleeps may stop one of its two clocks.
   * @returns {number} s
   */
  get console() {
    return Math.max(0, performance.now() - this.running, Date.now() - this.wall) / 1000;
  }

  /**
   * @param {number | null | undefined} age s, as of the last beat
   * @returns {number | null} s; null: it has never been heard
   */
  now(age) { return age === null || age === undefined ? null : age + this.console; }

  get master() { return this.now(this.heard?.master); }

  /** @param {string} name of a query server */
  server(name) { return this.now(this.heard?.servers[name]); }

  /** @param {string} name */
  robot(name) { return this.now(this.heard?.robots[name]); }

  /** Whether a robot has been heard before, and is heard no longer.
   * @param {string} name */
  isSilent(name) { return tooOld(this.robot(name)); }

  /** What is silent for all robots together. */
  get silent() {
    if (tooOld(this.console)) return 'console';
    return tooOld(this.master) ? 'master' : '';
  }

  /**
   * Who must be heard for a question to be answered, and is not; '' where all are.
   * @param {server.Question} question
   */
  whoIsSilent({ server, robot }) {
    return this.whoOf(robot) || (tooOld(this.server(server)) ? server : '');
  }

  /**
   * Who must be heard for a robot to be commanded, and is not; '' where all are.
   * @param {string} robot
   */
  whoOf(robot) {
    if (this.silent) return this.silent === 'console' ? 'the console' : 'the ROS master';
    return tooOld(this.robot(robot)) ? robot : '';
  }

  /**
   * Why no answer is sent; '' where one may be.
   * @param {server.Question} question
   */
  refusal(question) { return unheard(this.whoIsSilent(question)); }

  /**
   * Why nothing is sent that would have a robot go on; '' where it may be.
   * @param {string} robot
   */
  refusalOfRobot(robot) { return unheard(this.whoOf(robot)); }

  /**
   * Why a question is gone, where its robot or its shared server is; '' where that is not known:
   * from a console or a master that is silent nothing is heard of any robot.
   * @param {server.Question} question
   */
  gone({ server, robot }) {
    if (this.silent) return '';
    const known = (this.store.get('servers') || []).find(({ name }) => name === server);
    const ownServer = server.startsWith(robot + '/'); // it ends with the robot
    if (this.isSilent(robot) || (!known?.connected && ownServer)) {
      return robot + ' is gone: its process has ended, or cannot be reached. Its question went '
        + 'with it. ';
    }
    return known?.connected ? '' : server + ' is gone. ' + robot + ' asks again once it is back. ';
  }

  /** For the top bar. */
  ages() { return 'console ' + aged(this.console) + ' · master ' + aged(this.master); }
}

/** @param {string} who is silent; '' where nobody is */
function unheard(who) { return who && 'Not sent: nothing is heard from ' + who + ' any more.'; }

/**
 * @param {number | null} age s
 * @returns {boolean}
 */
function tooOld(age) { return age !== null && age > SILENT_AFTER_S; }

/**
 * @param {number | null} age s; null: never heard
 */
export function aged(age) { return age === null ? 'not heard' : duration(age); }
