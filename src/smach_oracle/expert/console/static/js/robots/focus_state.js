// @ts-check
// Which state of a container people want to see first.

/**
 * The states of a container that are active now.
 * @param {string} path
 * @param {machine.MachineState} machine
 */
export function activeIn(path, machine) {
  return machine.alive ? machine.active[path] || [] : [];
}

/**
 * The state that failed, else one that is active; '' where there is none.
 * @param {server.Graph} graph
 * @param {machine.MachineState} machine
 */
export function focusState({ path, states }, machine) {
  const failed = machine.failed[path]?.state;
  const labels = [failed, ...activeIn(path, machine)];
  return labels.find((label) => states.some((state) => state.label === label)) || '';
}
