// @ts-check
// How a machine stands as its operators see it, in words.

/** @typedef {import('../server').ActiveState} ActiveState */
/** @typedef {import('../server').HeldMachine} HeldMachine */

/**
 * The machine to which a container belongs; undefined where it is of none.
 * @param {HeldMachine[]} machines
 * @param {string} path
 */
export function machineOf(machines, path) {
  return machines.find((each) => (path + '/').startsWith(each.path + '/'));
}

/** @param {ActiveState} active */
function inWords({ state, path }) { return state + ' in ' + path; }

/** @param {ActiveState[]} states */
export function listed(states) { return states.map(inWords).join(', '); }

/**
 * The states that run, but for those within which others are active.
 * @param {HeldMachine} machine
 */
function running({ active }) {
  const around = new Set(active.map(({ path }) => path));
  return active.filter(({ held, path, state }) => !held && !around.has(path + '/' + state));
}

/**
 * What waits.
 * @param {HeldMachine} machine
 */
export function waiting({ active }) { return active.filter(({ held }) => held); }

/**
 * What waits for nothing but that the pause is lifted.
 * @param {HeldMachine} machine
 */
export function resumable(machine) { return waiting(machine).filter(({ confirm }) => !confirm); }

/**
 * By the container that waits before them.
 * @param {ActiveState[]} states
 */
export function byContainer(states) {
  /** @type {Map<string, ActiveState[]>} */
  const found = new Map();
  for (const each of states) found.set(each.path, [...(found.get(each.path) || []), each]);
  return [...found];
}

/** @param {HeldMachine} machine */
export function standingWords(machine) {
  const waits = waiting(machine);
  const runs = running(machine);
  const by = machine.by ? ' by ' + machine.by : '';
  if (!machine.running) {
    return 'It does not run.' + (machine.paused ? ' It is paused' + by
      + ': once it is started it waits before its first state.' : '');
  }
  const told = machine.paused ? ['Paused' + by + '.'] : [];
  if (waits.length) told.push('Waits before ' + listed(waits) + '.');
  const runsOn = machine.paused ? 'Runs to its end: ' : 'Runs: ';
  if (runs.length) told.push(runsOn + listed(runs) + '.');
  return told.join(' ') || 'It runs.';
}
