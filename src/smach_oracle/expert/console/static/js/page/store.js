// @ts-check
// The newest sections that the server has sent; they are kept while the connection is away.
import { changed as rowsAfter } from './row_lists.js';

const LISTS = new Set(['trials', 'bags', 'acts']); // of these come changes alone

export class Store {
  constructor() {
    /** @type {Map<string, unknown>} */
    this.sections = new Map();
    /** @type {((names: string[]) => void)[]} */
    this.listeners = [];
    /** @type {((slice: server.EventSlice) => void)[]} */
    this.eventListeners = [];
    this.offset = 0; // s, of the server's clock to this one
  }

  /**
   * @template {keyof server.Sections} Name
   * @param {Name} name
   * @returns {server.Sections[Name] | undefined}
   */
  get(name) { return /** @type {server.Sections[Name] | undefined} */ (this.sections.get(name)); }

  get questions() { return this.get('questions') || []; }

  get sensors() { return this.get('sensors')?.sensors || []; }

  /**
   * The server's clock.
   * @returns {number} s
   */
  now() { return Date.now() / 1000 + this.offset; }

  /** @param {(names: string[]) => void} listener */
  onChange(listener) { this.listeners.push(listener); }

  /**
   * @param {(slice: server.EventSlice) => void} listener
   * @returns {() => void} ends it
   */
  onEvents(listener) {
    this.eventListeners.push(listener);
    return () => {
      this.eventListeners = this.eventListeners.filter((each) => each !== listener);
    };
  }

  /** @param {server.Batch} batch */
  receive({ now, all, sections = {}, lists = {}, events }) {
    this.offset = now - Date.now() / 1000;
    /** @type {Map<string, unknown>} */
    const changed = new Map(Object.entries(sections));
    if (all) {
      for (const name of this.sections.keys()) {
        if (!changed.has(name) && !LISTS.has(name)) changed.set(name, null);
      }
    }
    const { trials, bags, acts } = lists;
    if (trials !== undefined) changed.set('trials', trials && this.withTrials('trials', trials));
    if (bags !== undefined) changed.set('bags', bags && this.withTrials('bags', bags));
    if (acts !== undefined) {
      changed.set('acts', acts && { acts: rowsAfter(this.get('acts')?.acts, acts) });
    }
    for (const [name, section] of changed) {
      if (section === null) this.sections.delete(name);
      else this.sections.set(name, section);
    }
    const names = [...changed.keys()];
    if (names.length) this.listeners.forEach((listener) => listener(names));
    if (events) this.eventListeners.forEach((listener) => listener(events));
  }

  /**
   * @param {'trials' | 'bags'} name
   * @param {server.TrialsChange | server.BagsChange} change
   */
  withTrials(name, change) {
    const old = this.get(name);
    return { ...old, ...change.rest, trials: rowsAfter(old?.trials, change) };
  }
}
