// What the server sends: every shape of JSON, as the server makes it. What the page sends is in
// commands.d.ts. test/unit/expert/console/test_console_types.py compares both with what
// the server does.
// Times are seconds since the epoch, lengths metres, unless something else is written beside them.
import { Colour, Vector } from './drawing/types';
import { DownMachine } from './down';
import { RobotHealth } from './fleet';
import { HeldMachine } from './holding';
import { Act, ActOverview, People } from './people';
import { Reach } from './reach';
import {
  FailureClass, InterfaceOutput, KeptImage, PreconditionStatus, QueryServer, Question,
} from './question';

export type Role = 'viewer' | 'operator' | 'teleoperator';

/** GET, POST and DELETE /session: who uses this browser. */
export interface Session {
  signed_in: boolean;
  role: Role | '';
  name: string; // '' where the person may choose
  tokens: boolean; // whether one signs in here at all
  xsrf: string;
}

// --- what the socket sends

/** What has changed since the batch before; `now` is the server's clock. */
export interface Batch {
  now: number;
  all?: true; // what is not among the sections is gone
  sections?: { [Name in keyof Sections]?: Sections[Name] | null }; // null: it is gone
  lists?: {
    trials?: ListChange<TrialOverview, Trial> | null;
    bags?: ListChange<BagOverview, Trial> | null;
    acts?: ListChange<ActOverview, Act> | null;
  };
  events?: EventSlice;
}

/** What has changed in a list; only pages that look at it get this. */
export interface ListChange<List, Row> {
  all?: true; // no row of before is left
  rest?: Omit<List, 'trials' | 'acts'>; // what is beside the rows
  rows: [before: string, row: Row][]; // with the id of the row before it; '': it is the first
  gone?: string[]; // ids
}

/** Named pieces of what the pages show; each comes whole, but for the lists. */
export interface Sections {
  heard: Heard;
  onlookers: ByKey<Onlooker[]>;
  questions: Question[];
  servers: QueryServer[];
  preconditions: ByKey<ByState<PreconditionStatus[]>>;
  images: ByKey<KeptImage[]>;
  cameras: { [robot: string]: string[] | undefined }; // topics of its own, the likeliest first
  robots: string[]; // names of their nodes
  health: { [robot: string]: RobotHealth | undefined };
  down: DownMachine[];
  trials: TrialOverview;
  bags: BagOverview;
  acts: ActOverview;
  people: People;
  sensors: { sensors: Sensor[]; perception: ByKey<PerceptionSensors> };
  manipulation: ByKey<Manipulation>;
  interface_output: ByKey<InterfaceOutput>;
  reach: Reach; // only where there is an on-call list
  [name: `live ${string}`]: LiveMachines; // by robot
  [name: `graph ${string}`]: Graph; // by robot and container path
}

/** By the key of a question. */
export interface ByKey<Value> { [key: string]: Value | undefined }
/** By the label of a state. */
export interface ByState<Value> { [label: string]: Value | undefined }
/** By the path of a container, such as KITCHEN/FETCH. */
export interface ByPath<Value> { [path: string]: Value | undefined }

/** How long ago they were heard when this was sent, s; null: never. */
export interface Heard {
  beat: number; // the console's monotonic clock
  master: number | null;
  servers: { [name: string]: number | null | undefined };
  robots: { [name: string]: number | null | undefined }; // by the name in questions
}

/** A page that shows a question. */
export interface Onlooker {
  name: string; // '' where the person has given none
  role: Role;
  session: string; // of its browser, in short
}

// --- robots

/** What the containers of a robot do. */
export interface LiveMachines {
  trial: string;
  alive: boolean;
  unwell: string; // why it waits until it is well; '' where it does not
  last: { words: string; at: number } | null; // what it said last
  active: ByPath<string[]>;
  latest: ByPath<[from: string, to: string]>; // transitions; from '': the oracle
  failed: ByPath<{ state: string; rate: number | null }>;
  rates: ByPath<ByState<LearnedRate>>;
  counts: ByPath<TransitionCount[]>;
  paths: string[];
  control: HeldMachine[] | null; // null: its machines cannot be held
}

export interface LearnedRate {
  rate: number | null;
  class: FailureClass;
  successes: number;
  failures: number;
  recoveries: number;
  preconditions: boolean;
}

/** A transition that was taken, and its share of all that left its state. */
export type TransitionCount =
  [from: string, outcome: string, to: string, times: number, share: number];

/** A container, and where dot has laid its states. Lengths are px. */
export interface Graph {
  path: string;
  oracle: string; // its label; '' where there is none
  drawn: boolean; // whether there is a layout
  size: [width: number, height: number] | null;
  states: { label: string; nested: boolean; at: Place | null }[];
  outcomes: { label: string; at: Place | null }[];
  edges: GraphEdge[];
  bundled: { [outcome: string]: number | undefined }; // edges of preemption that have no points
  refused: number; // states, where they are too many: none of them is told. Else 0
}

/** px, of the middle. */
export type Place = [x: number, y: number, width: number, height: number];

export interface GraphEdge {
  from: string;
  outcome: string;
  to: string;
  points: number[]; // x, y, x, y, ... of Bezier curves, the arrow's tip at the end
  label: [x: number, y: number] | null;
}

// --- trials

export type EventKind = 'trial_start' | 'trial_end' | 'container_start' | 'container_end'
  | 'state_start' | 'transition' | 'failure' | 'precondition_start' | 'precondition_end'
  | 'decision' | 'jump' | 'query_opened' | 'query_claimed' | 'query_released' | 'query_answered'
  | 'query_expired' | 'query_cancelled' | 'interface_start' | 'interface_end' | 'supersede'
  | 'give_up' | 'preempt' | 'warning' | 'health_wait_start' | 'health_wait_end'
  | 'operator_command' | 'hold_start' | 'hold_end' | 'announce' | 'sent' | 'resumed'
  | `${number}`; // of a later release

export interface TrialEvent {
  seq: number;
  kind: EventKind;
  t: number;
  path: string;
  state: string;
  outcome: string;
  target: string;
  class: FailureClass;
  rate: number | null;
  continuous: boolean;
  counted: boolean; // false: of a transition that says nothing of how good its state is
  query: string; // id of the question
  by: string; // the expert
  text: string;
  words: string; // what happened, in a sentence
}

/** Events of the trial that is watched, from a position on. */
export interface EventSlice { trial: string; from: number; events: TrialEvent[] }

export interface TrialOverview { table: CountsRow[]; trials: Trial[]; heard: number }

export interface Trial {
  id: string;
  robot: string;
  experiment: string;
  start: number;
  end: number;
  // 'other': neither a success nor a failure by its outcome; '': it runs
  ending: 'success' | 'failure' | 'other' | 'preempted' | 'unfinished' | '';
  outcome: string;
  oracle: boolean; // whether it recovers
  failures: number;
  recoveries: number;
  questions: number;
  answered: number;
  lost: number; // events that were not heard
  nth?: number; // of its machine in its process, 0 where it is not known; not of a bag's trial
  detailed: boolean; // whether its events are kept
  number?: number; // of a trial of a bag
  bag?: string;
}

/** A row of the paper's Table I. */
export interface CountsRow {
  experiment: string;
  oracle?: boolean; // of trials that were heard
  arm?: string; // of trials of bags: the variant
  trials: number;
  // other: only where there are some
  endings: { success: number; failure: number; other?: number; preempted: number;
    unfinished?: number };
  counts: { failures: Count; recoveries: Count; questions: Count; answered: Count };
  unwell_s: number; // in which they waited, all together, until the robot was well
}

/** In how many trials, and how often in all. */
export interface Count { trials: number; events: number | null }

export interface BagOverview {
  waiting: number; // bags that are still to be read
  note: string;
  table: CountsRow[];
  trials: Trial[];
  broken: { name: string; reason: string }[];
}

/** GET /recorded/NUMBER: a trial of a bag. */
export interface RecordedTrial {
  events: TrialEvent[];
  graphs: ByPath<Graph>;
  images: { [query: string]: KeptImage[] | undefined };
}

// --- sensors

export type SensorKind = 'image' | 'cloud' | 'robot' | 'joints';

export interface Sensor { id: number; topic: string; kind: SensorKind; type: string }

/** Numbers of the sensors of a perception interface's image and cloud; null: there is none yet. */
export interface PerceptionSensors { image: number | null; cloud: number | null }

/** GET /sample/NUMBER: what is told beside the newest message of a sensor. */
export interface SensorFacts { sequence: number }

export interface StampedFacts extends SensorFacts {
  frame: string; // of its coordinates
  stamp: string; // seconds.nanoseconds
  age?: number | null; // s, by the robot's clock; null: not known
}

export interface ImageFacts extends StampedFacts {
  kind: 'colour' | 'depth';
  size: [width: number, height: number]; // px, of the original
  range?: [near: number, far: number];
}

export interface CloudFacts extends StampedFacts {
  kind: 'cloud';
  count: number;
  of: number; // points that there are
  offset: Vector; // positions are 16 bit shares of the scale, from the offset on
  scale: Vector;
  place?: number[]; // 3 x 4, by rows: at the robot that was asked for
  astray?: string; // why that is not known
}

export interface JointFacts extends StampedFacts { kind: 'joints'; joints: JointRow[] }
type Measured = number | null;
export type JointRow = [name: string, position: Measured, velocity: Measured, effort: Measured];

export interface RobotFacts extends SensorFacts {
  kind: 'robot';
  model: string; // version
  root: string; // link
  joints: number; // that are known
}

/** GET /model/NUMBER begins with this: what a robot looks like. */
export interface ModelHeader {
  name: string;
  version: string;
  root: string;
  links: string[];
  geometries: { corners: number; triangles: number; offset: Vector; scale: Vector }[];
  missing: string[];
  lost: number;
  parts: [link: number, geometry: number, pose: number[], colour: Colour][];
}

// --- driving

export type DriveFrame = 'tool' | 'base' | 'camera';

/** A manipulation interface that runs for a question. */
export interface Manipulation {
  frames: DriveFrame[];
  arms: string[];
  boxes: number | null; // in the robot's collision map; null: there is none
  wheel: number | null; // which page drives
  driver: string;
  state?: HandState;
}

export interface HandState {
  arm: string;
  moving: boolean;
  limit: string; // what slows it
  refused: string;
  share: number | null; // of the commanded speed
  speed: number | null; // m/s
  clearance: number | null;
  gripper: number | null; // m between the fingers
  stalled: boolean;
  at: [x: number | null, y: number | null, z: number | null]; // the tool
}

export * from './commands';
export * from './fleet';
export * from './holding';
export * from './reach';
export * from './people';
export * from './question';
