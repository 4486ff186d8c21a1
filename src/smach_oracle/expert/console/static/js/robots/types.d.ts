// Shapes of machines as they are drawn.
import { ByPath, ByState, Graph, HeldMachine, LearnedRate, TransitionCount } from '../server';

export as namespace machine;

/** What the containers of a robot do at a moment. */
export interface MachineState {
  alive?: boolean; // false: the robot is gone
  unwell?: string; // why it waits until it is well
  control?: HeldMachine[] | null; // how its machines stand as operators see them
  active: ByPath<string[]>;
  latest: ByPath<[from: string, to: string]>;
  failed: ByPath<{ state: string }>;
  rates: ByPath<ByState<ShownRate>>;
  counts: ByPath<TransitionCount[]>;
  paths: string[];
}

export type ShownRate = Pick<LearnedRate, 'rate' | 'class' | 'successes' | 'failures'>;

/** A container of a robot. */
export interface Place { robot: string; path: string }

/** Where a view of machines has them from: the robot now, or a trial at a moment. */
export interface MachineSource {
  graph(robot: string, path: string): Graph | undefined;
  state(robot: string): MachineState;
}
