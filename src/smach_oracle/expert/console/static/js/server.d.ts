// What the server sends, and what the page does: every shape of JSON. Written by
// doc/write_page_types.py from the types in shapes/. test/unit/expert/console/test_console_types.py
// compares both with what the server does.
// Times are seconds since the epoch, lengths metres, unless something else is written beside them.

export as namespace server;

/** A reply, by the name of its command: `data` is there for those that hold more than words. */
export interface Reply<Name extends keyof Commands = keyof Commands> {
  re: number; // the command's number
  ok: boolean;
  message: string;
  data?: Name extends keyof ReplyData ? ReplyData[Name] : never;
}
export interface ReplyData { hello: HelloData; mark: Marked; take_wheel: WheelData }

// --- basics

export interface ByKey<Value> { [name: string]: Value | undefined } // by the key of a question
export interface ByState<Value> { [name: string]: Value | undefined } // by the label of a state
export interface ByPath<Value> { [name: string]: Value | undefined } // by the path of a container
// Texts of which the scripts get a closed set: doc/write_page_types.py has the constants for it.
export type Role = 'viewer' | 'operator' | 'teleoperator';
export type DriveFrame = 'tool' | 'base' | 'camera';
export type OutcomeMeaning = 'success' | 'failure' | 'preempted' | 'other end'; // of the work
export type TrialEnd = 'success' | 'failure' | 'preempted' | 'other' | 'unfinished' | '';
export type EventName = 'trial_start' | 'trial_end' | 'container_start' | 'container_end'
  | 'state_start' | 'transition' | 'failure' | 'precondition_start' | 'precondition_end'
  | 'decision' | 'jump' | 'query_opened' | 'query_claimed' | 'query_released' | 'query_answered'
  | 'query_expired' | 'query_cancelled' | 'interface_start' | 'interface_end' | 'supersede'
  | 'give_up' | 'preempt' | 'warning' | 'health_wait_start' | 'health_wait_end' | 'operator_command'
  | 'hold_start' | 'hold_end' | 'announce' | 'sent' | 'resumed' | `${number}`;
export type SensorKind = 'image' | 'cloud' | 'robot' | 'joints';
export type HealthLevel = 'warn' | 'error' | 'stale';
export type CallStatus = 'waiting' | 'sent' | 'failed' | 'dropped';
export type FailureClass = 0 | 1 | 2 | 3; // none, low, moderate, high
export type Vector = [number, number, number]; // x, y, z
export type Size = [number, number]; // width, height, px

// --- page

/** GET, POST and DELETE /session: who uses this browser. */
export interface Session {
  signed_in: boolean;
  role: Role | ''; // '' where nobody is signed in
  name: string; // '' where the person may choose
  tokens: boolean; // whether one signs in here at all
  xsrf: string;
}

/** Named pieces of what the pages show; each comes whole, except the lists. A name in capital
 * words stands for all that begin like it.
 */
export interface Sections {
  heard: Heard;
  onlookers: ByKey<Onlooker[]>;
  questions: Question[];
  servers: QueryServer[];
  preconditions: ByKey<ByState<PreconditionStatus[]>>;
  images: ByKey<KeptImage[]>;
  replays: ByKey<number>; // numbers of what came before a failure: GET /replay/NUMBER
  // of a robot, topics of its own, the likeliest first
  cameras: { [name: string]: string[] | undefined };
  robots: string[]; // names of their nodes
  health: { [name: string]: RobotHealth | undefined }; // by robot
  down: DownMachine[];
  trials: TrialOverview;
  bags: BagOverview;
  acts: ActOverview;
  people: People;
  sensors: SensorList;
  manipulation: ByKey<Manipulation>;
  interface_output: ByKey<InterfaceOutput>;
  reach: Reach; // only where there is an on-call list
  [name: `live ${string}`]: LiveMachines;
  [name: `graph ${string}`]: Graph;
}

/** What has changed in the list of live trials; only pages that look at it get this. */
export interface TrialsChange {
  all?: true; // no row of before is left
  gone?: string[]; // ids
  rows: [string, Trial][]; // with the id of the row before it; '': it is the first
  rest?: TrialRest; // what is beside the rows
}

/** The same of the trials of bags. */
export interface BagsChange {
  all?: true; // no row of before is left
  gone?: string[]; // ids
  rows: [string, Trial][]; // with the id of the row before it; '': it is the first
  rest?: BagRest;
}

/** The same of what people did. */
export interface ActsChange {
  all?: true; // no row of before is left
  gone?: string[]; // ids
  rows: [string, Act][];
  rest?: { [name: string]: string | undefined }; // nothing
}

/** What has changed in the lists. */
export interface ListChanges {
  trials?: TrialsChange | null; // null: it is gone
  bags?: BagsChange | null;
  acts?: ActsChange | null;
}

/** Events of the trial that is watched, from a position on. */
export interface EventSlice {
  trial: string;
  from: number;
  events: TrialEvent[];
}
// of Sections; null: it is gone
export type SomeSections = { [Name in keyof Sections]?: Sections[Name] | null };

/** What has changed since the batch before. */
export interface Batch {
  now: number; // the server's clock
  all?: true; // what is not among the sections is gone
  sections?: SomeSections;
  lists?: ListChanges;
  events?: EventSlice;
}

// --- questions

export type VisitResult = 'success' | 'failure' | 'superseded' | 'preempted' | '';
export type Missing = 'unheard' | 'older' | '';
export type QuestionStatus = 'pending' | 'claimed' | 'interface';
export type InterfaceStatus = 'starting' | 'running' | 'failed' | 'stopped' | '';

/** A visit of a state. */
export interface Visit {
  state: string;
  outcome: string;
  result: VisitResult;
}

/** A container around, as this console has heard of it. */
export interface LevelVisits {
  path: string;
  state: string; // that runs in it
  visits: Visit[]; // before it, oldest first
  missing: Missing; // what comes before these; '': nothing
}

/** A state to go to. */
export interface StateChoice {
  class: FailureClass;
  state: string;
  container: string; // path of another one than that of the failed state; '': that one
  success: number | null; // predicted, 0 to 1
  visits: number; // in this trial
  missing: string[]; // userdata that it needs and would not have
  preconditions: string[];
  blocked: string; // why; '' where it is not
  repeats: string[]; // states that are not repeated by themselves
  runs_again: string[]; // branches of a Concurrence, which all run again
  helped: [number, number]; // how often going there helped, and how often it was tried
  helped_s: number | null; // mean time until it did; null: only this console has counted
  recommended: string; // why; '' where it is not
}

/** An outcome with which the failed state may count as done. */
export interface OutcomeChoice {
  outcome: string;
  target: string;
  meaning: OutcomeMeaning;
}

/** An outcome of a container above. */
export interface LevelOutcome {
  container: string;
  outcome: string;
}

/** A shared-autonomy interface that can be begun. */
export interface InterfaceOffer {
  name: string;
  description: string;
}

/** A key of the userdata. */
export interface UserdataItem {
  key: string;
  type: string; // of a ROS message, with [] of a list of them; '' of plain data
  value: string; // JSON of plain data
  note: string; // why it is not shown
}

/** An open question. */
export interface Question {
  class: FailureClass;
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
  rate: number | null;
  continuous: boolean;
  recoveries: number; // that were spent on it
  reason: string; // why the oracle asks
  tried: string[];
  status: QuestionStatus;
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

/** A server that questions come from. */
export interface QueryServer {
  name: string;
  connected: boolean;
}

/** A precondition of a state to go to, as its robot has checked it. */
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
  size: Size;
}

/** What an interface has printed. */
export interface InterfaceOutput {
  status: InterfaceStatus;
  text: string;
  lines: string[];
}

/** A page that shows a question. */
export interface Onlooker {
  name: string; // '' where the person has given none
  role: Role;
  session: string; // of its browser, in short
}

// --- robots

// the transition made last: from, to; from '': the oracle
export type LatestTransition = [string, string];

/** The time (s) since they were heard, when this was sent; null: never. */
export interface Heard {
  beat: number; // the console's monotonic clock
  master: number | null;
  servers: { [name: string]: number | null | undefined };
  robots: { [name: string]: number | null | undefined }; // by the name in questions
}

/** The failure rate of a state, and what it was learned from. */
export interface LearnedRate {
  class: FailureClass;
  rate: number | null;
  successes: number;
  failures: number;
  recoveries: number;
  preconditions: boolean;
}

/** The state of a container that has failed last, while its robot is at a loss. */
export interface FailedState {
  state: string;
  rate: number | null;
}

/** What a robot said last. */
export interface LastWord {
  words: string;
  at: number;
}

/** A state that runs, or before which its container waits. */
export interface ActiveState {
  path: string;
  state: string;
  held: '' | 'paused' | 'breakpoint' | 'confirm'; // '': it runs
  confirm: boolean; // it waits for a confirmation
}

/** A top-level machine as its operators see it, who may hold it. */
export interface HeldMachine {
  path: string;
  running: boolean;
  paused: boolean;
  by: string; // who has paused it, or 'breakpoint PATTERN'
  active: ActiveState[];
  breakpoints: string[]; // patterns
}

/** What the containers of a robot do. */
export interface LiveMachines {
  trial: string;
  alive: boolean;
  unwell: string; // why it waits until it is well; '' where it does not
  last: LastWord | null;
  active: ByPath<string[]>;
  latest: ByPath<LatestTransition>;
  failed: ByPath<FailedState>;
  rates: ByPath<ByState<LearnedRate>>;
  counts: ByPath<TransitionCount[]>;
  paths: string[];
  control: HeldMachine[] | null; // null: its machines cannot be held
}

/** A battery of a robot. */
export interface Battery {
  share: number | null; // of its charge, 0 to 1; null: it does not say
  volts: number | null;
  charging: boolean;
  low: boolean;
  old: boolean; // it has not been heard for a while
}

/** What diagnostics say of a part of a robot. */
export interface HealthProblem {
  part: string;
  level: HealthLevel;
  message: string;
}

/** The health of a robot of which anything is known. */
export interface RobotHealth {
  battery: Battery | null;
  problems: HealthProblem[]; // the worst first
}

/** A machine whose program has stopped, as its store has it; or why a store cannot be read. */
export interface DownMachine {
  key: string; // of the store and the trial
  store: string; // its file
  machine: string;
  trial: number; // in the store
  moment: number; // the latest one of the trial
  states: string[]; // where it can go on
  since: number; // when its program stored something last
  stood: string[]; // where, in sentences
  questions: string[]; // that were open
  userdata: [string, string, string][]; // container, key, JSON
  more_userdata: number; // keys that are left out
  command: string; // that shows more
  problem: string; // why the store cannot be read; '': it can, and all else is filled
}

// --- drawn graph

export type Place = [number, number, number, number]; // x and y of the middle, width, height
export type Spot = [number, number]; // x, y
// a transition that was taken: state, outcome, target, how often, share of all that left its state
export type TransitionCount = [string, string, string, number, number];

/** A state in a graph. */
export interface GraphState {
  label: string;
  nested: boolean;
  at: Place | null;
}

/** An outcome of the container, in its graph. */
export interface GraphOutcome {
  label: string;
  at: Place | null;
}

export interface GraphEdge {
  from: string;
  outcome: string;
  to: string;
  points: number[]; // x, y, x, y, ... of Bezier curves, the arrow's tip at the end
  label: Spot | null;
}

/** A container, and where dot has laid its states. */
export interface Graph {
  path: string;
  oracle: string; // its label; '' where there is none
  drawn: boolean; // whether there is a layout
  size: [number, number] | null; // width, height
  states: GraphState[];
  outcomes: GraphOutcome[];
  edges: GraphEdge[];
  // edges of preemption that have no points, by outcome
  bundled: { [name: string]: number | undefined };
  refused: number; // states, where they are too many: none of them is told. Else 0
}

// --- trials

/** An event of a trial. */
export interface TrialEvent {
  class: FailureClass;
  seq: number;
  kind: EventName;
  t: number;
  path: string;
  state: string;
  outcome: string;
  target: string;
  rate: number | null;
  continuous: boolean;
  counted: boolean; // false: of a transition that says nothing of how good its state is
  query: string; // id of the question
  by: string; // the expert
  text: string;
  words: string; // what happened, in a sentence
}

/** A trial, as the lists of them have it. */
export interface Trial {
  id: string;
  robot: string;
  experiment: string;
  start: number;
  end: number;
  // 'other': neither a success nor a failure by its outcome; '': it runs
  ending: TrialEnd;
  outcome: string;
  oracle: boolean | null; // whether it recovers; null: its bag does not say
  failures: number;
  recoveries: number;
  questions: number;
  answered: number;
  lost: number; // events that were not heard
  detailed: boolean; // whether its events are kept
  nth?: number; // of its machine in its process, 0 where it is not known; not of a bag's trial
  number?: number; // of a trial of a bag
  bag?: string;
}

/** The number of trials in which a thing happened, and how often it did in all. */
export interface Count {
  trials: number;
  events: number | null;
}

/** The counts of the things that happen in trials. */
export interface TrialCounts {
  failures: Count;
  recoveries: Count;
  questions: Count;
  answered: Count;
}

/** The numbers of trials that ended in each way. */
export interface Endings {
  success: number;
  failure: number;
  preempted: number;
  other?: number; // only where there are some
  unfinished?: number;
}

/** A row of the paper's Table I. */
export interface CountsRow {
  experiment: string;
  trials: number;
  endings: Endings;
  counts: TrialCounts;
  unwell_s: number; // in which they waited, all together, until the robot was well
  oracle?: boolean; // of trials that were heard
  arm?: string; // of trials of bags: the variant
}

/** What comes with the list of live trials. */
export interface TrialRest {
  table: CountsRow[];
  heard: number;
}

/** The live trials. */
export interface TrialOverview extends TrialRest {
  trials: Trial[];
}

/** A bag that cannot be read. */
export interface BrokenBag {
  name: string;
  reason: string;
}

/** What comes with the list of trials of bags. */
export interface BagRest {
  waiting: number; // bags that are still to be read
  note: string;
  table: CountsRow[];
  broken: BrokenBag[];
}

/** The trials of bags. */
export interface BagOverview extends BagRest {
  trials: Trial[];
}

/** GET /recorded/NUMBER: a trial of a bag. */
export interface RecordedTrial {
  events: TrialEvent[];
  graphs: ByPath<Graph>;
  images: { [name: string]: KeptImage[] | undefined }; // by the id of a question
  // by the number of a failure's event: GET /replay/NUMBER
  replays: { [name: string]: number | undefined };
}

// --- sensors

export type Colour = [number, number, number]; // red, green, blue
// name, position, velocity, effort; null: it was not measured
export type JointRow = [string, number | null, number | null, number | null];
// link, geometry, pose (3 x 4, by rows), colour
export type LinkPart = [number, number, number[], Colour];

/** A sensor that can be watched. */
export interface Sensor {
  id: number;
  topic: string;
  kind: SensorKind;
  type: string;
}

/** Numbers of the sensors of a perception interface; null: there is none yet. */
export interface PerceptionSensors {
  image: number | null;
  cloud: number | null;
}

/** All sensors, and those of the perception interfaces that run. */
export interface SensorList {
  sensors: Sensor[];
  perception: ByKey<PerceptionSensors>;
}

/** GET /sample/NUMBER: what is told beside the newest message of a sensor. */
export interface SensorFacts {
  sequence: number;
}

/** Facts of a message with a header. */
export interface StampedFacts extends SensorFacts {
  frame: string; // of its coordinates
  stamp: string; // seconds.nanoseconds
  age?: number | null; // s, by the robot's clock; null: not known
}

/** Facts of an image. */
export interface ImageFacts extends StampedFacts {
  kind: 'colour' | 'depth';
  size: Size; // of the original
  range?: [number, number]; // nearest and furthest of a depth image
}

/** The points of a cloud, and where they are. */
export interface CloudSize {
  kind: 'cloud';
  count: number;
  of: number; // points that there are
  offset: Vector; // positions are 16 bit shares of the scale, from the offset on
  scale: Vector;
}

/** Facts of a cloud. */
export interface CloudFacts extends StampedFacts, CloudSize {
  place?: number[]; // 3 x 4, by rows: at the robot that was asked for
  astray?: string; // why that is not known
}

/** The joints of a robot. */
export interface JointFacts extends StampedFacts {
  kind: 'joints';
  joints: JointRow[];
}

/** Facts of a robot in 3D. */
export interface RobotFacts extends SensorFacts {
  kind: 'robot';
  model: string; // version
  root: string; // link
  joints: number; // that are known
}

/** A mesh, whose corners are 16 bit shares of the scale, from the offset on. */
export interface Geometry {
  corners: number;
  triangles: number;
  offset: Vector;
  scale: Vector;
}

/** GET /model/NUMBER begins with this: what a robot looks like. */
export interface ModelHeader {
  name: string;
  version: string;
  root: string;
  links: string[];
  geometries: Geometry[];
  missing: string[];
  lost: number;
  parts: LinkPart[];
}

/** The cloud of a marked object. */
export interface MarkedCloud extends CloudSize {
  data: string; // its bytes, in base64
}

/** An object that a perception interface has made out. */
export interface MarkedObject {
  frame: string;
  position: Vector;
  yaw: number; // rad
  points: number;
  size: Vector;
  cloud: MarkedCloud;
}

/** What a perception interface has made out. */
export interface Marked {
  outlines: number[][]; // x, y, x, y, ... px of each line around the mask
  elapsed: number; // s
  object?: MarkedObject;
}

/** The hand that is driven. */
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
  at: [number | null, number | null, number | null]; // the tool: x, y, z
}

/** A manipulation interface that runs for a question. */
export interface Manipulation {
  frames: DriveFrame[];
  arms: string[];
  boxes: number | null; // in the robot's collision map; null: there is none
  wheel: number | null; // which page drives
  driver: string;
  state?: HandState;
}

/** An event of a replay. */
export interface ReplayEvent {
  t: number; // s after the failure, below 0 before it
  kind: EventName;
  words: string;
}

/** A joint that moved. */
export interface JointCurve {
  name: string;
  samples: [number, number][]; // s after the failure, and the position
}

/** GET /replay/NUMBER: the last seconds before a failure. */
export interface Replay {
  seconds: number; // how long before the failure it may begin
  cameras: string[]; // topics
  frames: [number, number][]; // camera, and s after the failure
  events: ReplayEvent[];
  joints: JointCurve[]; // those that moved most
}

// --- people

export type Times = [number, number]; // mean and longest, s

/** A note for the next shift. */
export interface ShiftNote {
  id: string;
  at: number;
  who: string;
  text: string;
}

/** The answers of a person in a shift. */
export interface ShiftRow {
  who: string;
  answered: number; // questions
  claim: Times | null; // from the question on; null: nobody has claimed
  answer: Times | null; // from the question on
  resume: Times | null; // from the answer on, until the next state runs
}

/** A shift, with its people. */
export interface Shift {
  begin: number;
  people: ShiftRow[];
}

/** The notes and the shifts. */
export interface People {
  since: number; // the console began: before that it has heard nothing
  kept: boolean; // whether notes and times are in a file
  problem: string; // why that file cannot be read or written; '' where it can
  notes: ShiftNote[]; // newest first
  shifts: Shift[]; // newest first
}

/** A command that somebody gave. */
export interface Act {
  id: string;
  at: number;
  who: string;
  role: string;
  client: string; // address of the browser
  console: string;
  what: string;
  robot: string;
  ok: boolean;
  message: string;
}

/** What people did last, newest first. */
export interface ActOverview {
  acts: Act[];
}

/** A call to a person about a question. */
export interface Call {
  to: string; // person, and how
  status: CallStatus;
  why: string; // it is not there yet, or never will be
  at: number;
}

/** The people who are called next. */
export interface NextCall {
  people: string[];
  at: number;
}

/** A call that has not reached anybody. */
export interface FailedCall {
  to: string;
  question: string;
  why: string;
  at: number;
}

/** Whom the console calls about open questions. */
export interface Reach {
  calls: ByKey<Call[]>;
  next: ByKey<NextCall>;
  failed: FailedCall[]; // the newest last
}

// --- commands

export type AnswerKind = 'goto' | 'supersede' | 'give_up' | 'interface';
export type ImageFrame = 'at_goal' | 'fresh';
export type GripperWish = '' | 'open' | 'close';
export type Point = [number, number]; // px: right, down
export type LookedAt = 'trials' | 'people' | ''; // which lists are looked at

/** Who uses the page. */
export interface Hello {
  xsrf: string;
  expert: string;
}

/** A trial by its id. */
export interface OfTrial {
  trial: string;
}

/** The place that a person looks at. */
export interface Look {
  at: LookedAt;
}

/** A question by its key. */
export interface OfQuestion {
  question: string;
}

/** A value for the userdata. */
export interface Output {
  key: string;
  value: unknown;
  type: string;
}

/** An answer to a question. */
export interface Answer {
  kind: AnswerKind;
  name: string;
  container: string; // path of another one than that of the failed state; '': that one
  outputs: Output[];
  why: string;
}

/** An answer, and its question. */
export interface AnswerCommand extends OfQuestion, Answer {
  seen?: number; // the newest beat that the page has had
}

/** A line on an image, px. */
export interface Stroke {
  foreground: boolean;
  width: number;
  points: Point[];
}

/** What is drawn on an image. */
export interface Mark extends OfQuestion {
  stamp: string;
  region: Point[];
  strokes: Stroke[];
}

/** The image that is to be drawn on. */
export interface UseFrame extends OfQuestion {
  frame: ImageFrame;
}

/** A question, and why something is done about it. */
export interface WithReason extends OfQuestion {
  why: string;
}

/** The end of the work of an interface. */
export interface HandOver extends WithReason {
  outputs?: Output[];
  seen?: number; // the newest beat that the page has had
  outcome: string;
}

/** A machine of a robot, by the path of a container of it; '': all of the robot's. */
export interface OfMachine {
  robot: string;
  path: string;
}

/** A machine that goes on. */
export interface Start extends OfMachine {
  seen?: number; // the newest beat that the page has had
}

/** States before which a machine pauses. */
export interface Breakpoint extends OfMachine {
  pattern: string;
  remove: boolean;
}

/** Several robots; none: all that can be held. */
export interface ManyRobots {
  robots: string[];
}

/** A machine that is down, by the key and the moment of its row. */
export interface OfDown {
  down: string;
  moment: number;
}

/** The state at which it goes on. */
export interface GoToStored extends OfDown {
  label: string;
}

/** A value for its userdata. */
export interface EditStored extends OfDown {
  container: string;
  key: string;
  json: string;
}

/** A note for the next shift. */
export interface WriteNote {
  text: string;
}

/** A note by its id. */
export interface DropNote {
  note: string;
}

/** What a person holds. Axes are -1 to 1. */
export interface DriveWish {
  held: boolean;
  linear: Vector; // forward, left, up
  angular: Vector; // about these
  gripper: GripperWish;
}

/** A step of a hand. */
export interface Drive extends OfQuestion, DriveWish {
  frame: DriveFrame;
  arm: string;
  sent: number; // ms
}

/** Commands by their names, with their arguments. */
export interface Commands {
  hello: Hello;
  watch: OfTrial;
  look: Look;
  claim: OfQuestion;
  take_over: OfQuestion;
  release: OfQuestion;
  pressed: OfQuestion; // its holder is at work
  view: OfQuestion; // '': at none
  answer: AnswerCommand;
  mark: Mark;
  use_frame: UseFrame;
  hand_over: HandOver;
  give_up_interface: WithReason;
  take_wheel: OfQuestion;
  leave_wheel: OfQuestion;
  stop_hand: OfQuestion;
  stop_machine: OfMachine;
  pause_machine: OfMachine;
  stop_robots: ManyRobots;
  pause_robots: ManyRobots;
  resume_machine: Start;
  step_machine: Start;
  confirm_state: Start;
  set_breakpoint: Breakpoint;
  goto_stored: GoToStored;
  edit_stored: EditStored;
  drop_stored: OfDown;
  write_note: WriteNote;
  drop_note: DropNote;
  drive: Drive;
}

/** The session of this browser, in short. */
export interface HelloData {
  browser: string;
}

/** The number under which a page drives. */
export interface WheelData {
  wheel: number;
}
