// Shapes of machines as they are drawn.
import { ByPath, ByState, Graph, LearnedRate, LiveMachines } from '../server';

export as namespace machine;

/** What the containers of a robot do at a moment. */
export interface MachineState extends Pick<LiveMachines, 'active' | 'latest' | 'counts' | 'paths'>,
  Partial<Pick<LiveMachines, 'alive' | 'unwell'>> {
  failed: ByPath<{ state: string }>;
  rates: ByPath<ByState<ShownRate>>;
}

export type ShownRate = Pick<LearnedRate, 'rate' | 'class' | 'successes' | 'failures'>;

/** A container of a robot. */
export interface Place { robot: string; path: string }

/** Where a view of machines has them from: the robot now, or a trial at a moment. */
export interface MachineSource {
  graph(robot: string, path: string): Graph | undefined;
  state(robot: string): MachineState;
}
