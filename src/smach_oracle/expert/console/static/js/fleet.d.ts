// What is known of robots as a whole: a part of what the server sends.

/** Of a robot, where anything is known. */
export interface RobotHealth {
  battery: Battery | null;
  problems: HealthProblem[]; // the worst first
}

export interface Battery {
  share: number | null; // of its charge, 0 to 1; null: it does not say
  volts: number | null;
  charging: boolean;
  low: boolean;
  old: boolean; // it has not been heard for a while
}

export interface HealthProblem { part: string; level: 'warn' | 'error' | 'stale'; message: string }
