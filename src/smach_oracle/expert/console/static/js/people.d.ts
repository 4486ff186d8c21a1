// What people did at the consoles, how long it took them, and their notes.

export interface People {
  since: number; // the console began: before that it has heard nothing
  kept: boolean; // whether notes and times are in a file
  problem: string; // why that file cannot be read or written; '' where it can
  notes: ShiftNote[]; // newest first
  shifts: { begin: number; people: ShiftRow[] }[]; // newest first
}

export interface ShiftNote { id: string; at: number; who: string; text: string }

export interface ShiftRow {
  who: string;
  answered: number; // questions
  claim: Times | null; // from the question on; null: nobody has claimed
  answer: Times | null; // from the question on
  resume: Times | null; // from the answer on, until the next state runs
}

/** s. */
export type Times = [mean: number, longest: number];

export interface ActOverview { acts: Act[] }

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
