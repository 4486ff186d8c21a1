// An open question as the server sends it, and what belongs to it.
/** An open question. */
export interface Question {
  key: string; // tells questions of all robots apart
  server: string;
  id: string; // at its server
  trial: string;
  robot: string;
  path: string; // of the container
  state: string; // that failed
  stands: string; // 'failed', 'still runs' or 'is held back', to follow its name
  what: string; // went wrong, in words
  running: boolean; // it still runs: to go to it is to wait on
  outcome: string;
  text: string; // of an exception
  class: FailureClass;
  rate: number | null;
  continuous: boolean;
  recoveries: number; // that were spent on it
  reason: string; // why the oracle asks
  tried: string[];
  status: 'pending' | 'claimed' | 'interface';
  holder: string; // the expert who has claimed it
  session: string; // of the holder's browser, in short; '': not by this console
  idle: number; // for how many periods its holder has pressed nothing; 0 of other claims
  interface: string; // that runs for it
  asked: number;
  deadline: number | null; // null: it waits without end
  fallback: string;
  history: Visit[]; // of its container, as its robot knows it
  above: LevelVisits[]; // the containers around it, the outermost first
  choices: StateChoice[];
  supersede: OutcomeChoice[];
  outputs: string[]; // keys of the userdata that the state writes
  give_up: string[]; // outcomes
  give_up_above: LevelOutcome[]; // of the containers above
  interfaces: InterfaceOffer[];
  userdata: UserdataItem[];
}

export type FailureClass = 0 | 1 | 2 | 3; // none, low, moderate, high
export type VisitResult = 'success' | 'failure' | 'superseded' | 'preempted' | '';
export interface Visit { state: string; outcome: string; result: VisitResult }

/** A container around, as this console has heard of it. */
export interface LevelVisits {
  path: string;
  state: string; // that runs in it
  visits: Visit[]; // before it, oldest first
  missing: 'unheard' | 'older' | ''; // what comes before these; '': nothing
}

/** A state to go to. */
export interface StateChoice {
  state: string;
  container: string; // path of another one than that of the failed state; '': that one
  success: number | null; // predicted, 0 to 1
  class: FailureClass;
  visits: number; // in this trial
  missing: string[]; // userdata that it needs and would not have
  preconditions: string[];
  blocked: string; // why; '' where it is not
  repeats: string[]; // states that are not repeated by themselves
  runs_again: string[]; // branches of a Concurrence, which all run again
  helped: [helped: number, tried: number]; // how often going there helped
  helped_s: number | null; // mean time until it did; null: only this console has counted
  recommended: string; // why; '' where it is not
}

export interface LevelOutcome { container: string; outcome: string }
export type OutcomeMeaning = 'success' | 'failure' | 'preempted' | 'other end'; // of the work
export interface OutcomeChoice { outcome: string; target: string; meaning: OutcomeMeaning }
export interface InterfaceOffer { name: string; description: string }
export interface QueryServer { name: string; connected: boolean }

export interface UserdataItem {
  key: string;
  type: string; // of a ROS message, with [] of a list of them; '' of plain data
  value: string; // JSON of plain data
  note: string; // why it is not shown
}

export interface PreconditionStatus {
  name: string;
  holds: boolean | null; // null: unknown
  text: string;
  checked: number | null; // when; null: never
}

/** An image that the server keeps: what a camera gave when a question was put. */
export interface KeptImage {
  id: number;
  topic: string;
  late: number | null; // s after the question, below 0 before; null: it is of the failure itself
  stamped: boolean; // false: `late` is when it came
  size: [width: number, height: number]; // px
}

export interface InterfaceOutput {
  status: 'starting' | 'running' | 'failed' | 'stopped' | '';
  text: string;
  lines: string[]; // that it printed
}

