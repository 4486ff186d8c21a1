// @ts-check
// How a machine stands as its operators see it, in words.

/**
 * The machine to which a container belongs; undefined where it is of none.
 * @param {server.HeldMachine[]} machines
 * @param {string} path
 */
export function machineOf(machines, path) {
  return machines.find((each) => (path + '/').startsWith(each.path + '/'));
}

/** @param {server.ActiveState} active */
function inWords({ state, path }) { return state + ' in ' + path; }

/** @param {server.ActiveState[]} states */
export function listed(states) { return states.map(inWords).join(', '); }

/**
 * The states that run, but for those within which others are active.
 * @param {server.HeldMachine} machine
 */
export function running({ active }) {
  const around = new Set(active.map(({ path }) => path));
  return active.filter(({ held, path, state }) => !held && !around.has(path + '/' + state));
}

/**
 * What waits.
 * @param {server.HeldMachine} machine
 */
export function waiting({ active }) { return active.filter(({ held }) => held); }

/**
 * What waits for nothing but that the pause is lifted.
 * @param {server.HeldMachine} machine
 */
export function resumable(machine) { return waiting(machine).filter(({ confirm }) => !confirm); }

/**
 * By the container that waits before them.
 * @param {server.ActiveState[]} states
 */
export function byContainer(states) {
  /** @type {Map<string, server.ActiveState[]>} */
  const found = new Map();
  for (const each of states) found.set(each.path, [...(found.get(each.path) || []), each]);
  return [...found];
}

/**
 * Whether a state is the oracle of its container. One that has not been heard to act is the state
 * that no rates are told of.
 * @param {Pick<server.ActiveState, 'path' | 'state'>} active
 * @param {string} robot
 * @param {Pick<page.Store, 'get'>} store
 */
export function isOracle({ path, state }, robot, store) {
  const graph = store.get(`graph ${robot} ${path}`);
  if (!graph) return false;
  return graph.oracle ? graph.oracle === state : !graph.states.some(({ label }) => label === state);
}

/**
 * What the oracle of a container is at, as a sentence; '' where the state is no oracle.
 * @param {server.ActiveState} active
 * @param {string} robot
 * @param {Pick<page.Store, 'get' | 'questions'>} store
 */
function oracleWords(active, robot, store) {
  if (!isOracle(active, robot, store)) return '';
  const { path } = active;
  const asked = store.questions.find((each) => each.robot === robot && each.path === path);
  if (!asked) return 'The oracle of ' + path + ' decides what follows.';
  const about = asked.state + ' in ' + path + '.';
  return asked.status === 'interface' ? 'Interface ' + asked.interface + ' runs for ' + about
    : 'Waits for an answer about ' + about;
}

/**
 * @param {server.HeldMachine} machine
 * @param {string} robot
 * @param {Pick<page.Store, 'get' | 'questions'>} store for what an oracle is at
 */
export function standingWords(machine, robot, store) {
  const waits = waiting(machine);
  const active = running(machine);
  const oracles = active.map((each) => oracleWords(each, robot, store));
  const runs = active.filter((_, index) => !oracles[index]);
  const by = machine.by ? ' by ' + machine.by : '';
  if (!machine.running) {
    return 'It does not run.' + (machine.paused ? ' It is paused' + by
      + ': once it is started it waits before its first state.' : '');
  }
  const told = machine.paused ? ['Paused' + by + '.'] : [];
  if (waits.length) told.push('Waits before ' + listed(waits) + '.');
  const runsOn = machine.paused ? 'Runs to its end: ' : 'Runs: ';
  if (runs.length) told.push(runsOn + listed(runs) + '.');
  return told.concat(oracles.filter(Boolean)).join(' ') || 'It runs.';
}
