// What the console knows of machines that are down, of their stores.

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
  userdata: [container: string, key: string, json: string][];
  more_userdata: number; // keys that are left out
  command: string; // that shows more
  problem: string; // why the store cannot be read; '': it can, and all else is filled
}
