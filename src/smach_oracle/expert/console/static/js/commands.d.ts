// What the page sends: commands with their arguments, and what the replies hold. The server's
// commands.py checks every bit of it; test/unit/expert/console/test_console_types.py compares the
// two.
// Lengths are metres unless something else is written beside them.
import { DriveFrame, Marked, Vector } from './server';

interface OfQuestion { question: string } // its key

/** A machine of a robot, by the path of a container of it; '': all of the robot's. */
interface OfMachine { robot: string; path: string }

/** A machine that is down, by the key and the moment of its row. */
interface OfDown { down: string; moment: number }

/** A value for the userdata. */
export interface Output { key: string; value: unknown; type: string }

export type AnswerKind = 'goto' | 'supersede' | 'give_up' | 'interface';

export interface Answer {
  kind: AnswerKind;
  name: string;
  container: string; // path of another one than that of the failed state; '': that one
  outputs: Output[];
  why: string;
}

/** A line on an image, px. */
export interface Stroke { foreground: boolean; width: number; points: Point[] }
export type Point = [x: number, y: number];

/** What a person holds. Axes are -1 to 1. */
export interface DriveWish {
  held: boolean;
  linear: Vector; // forward, left, up
  angular: Vector; // about these
  gripper: '' | 'open' | 'close';
}

/** Commands by their names, with their arguments. */
export interface Commands {
  hello: { xsrf: string; expert: string };
  watch: { trial: string };
  look: { at: 'trials' | 'people' | '' }; // which lists are looked at
  claim: OfQuestion;
  take_over: OfQuestion;
  release: OfQuestion;
  pressed: OfQuestion; // its holder is at work
  view: { question: string }; // '': at none
  answer: OfQuestion & Answer & { seen?: number }; // the newest beat that the page has had
  mark: OfQuestion & { stamp: string; region: Point[]; strokes: Stroke[] };
  use_frame: OfQuestion & { frame: 'at_goal' | 'fresh' };
  hand_over: OfQuestion & { outcome: string; outputs?: Output[]; why: string; seen?: number };
  give_up_interface: OfQuestion & { why: string };
  take_wheel: OfQuestion;
  leave_wheel: OfQuestion;
  stop_hand: OfQuestion;
  stop_machine: OfMachine;
  pause_machine: OfMachine;
  stop_robots: { robots: string[] }; // []: all that can be held
  pause_robots: { robots: string[] };
  resume_machine: OfMachine & { seen?: number };
  step_machine: OfMachine & { seen?: number };
  confirm_state: OfMachine & { seen?: number };
  set_breakpoint: OfMachine & { pattern: string; remove: boolean };
  goto_stored: OfDown & { label: string };
  edit_stored: OfDown & { container: string; key: string; json: string };
  drop_stored: OfDown;
  write_note: { text: string };
  drop_note: { note: string }; // its id
  drive: OfQuestion & DriveWish & { frame: DriveFrame; arm: string; sent: number }; // ms
}

/** What a reply to some commands holds. */
export interface ReplyData {
  hello: { browser: string }; // the session of this browser, in short
  mark: Marked;
  take_wheel: { wheel: number };
}

export interface Reply<Name extends keyof Commands = keyof Commands> {
  re: number; // the command's number
  ok: boolean;
  message: string;
  data?: Name extends keyof ReplyData ? ReplyData[Name] : never;
}
