// How machines stand whose operators may hold them: a part of what the server sends.
/** How a top-level machine stands as its operators see it. */
export interface HeldMachine {
  path: string;
  running: boolean;
  paused: boolean;
  by: string; // who has paused it, or 'breakpoint PATTERN'
  active: ActiveState[];
  breakpoints: string[]; // patterns
}

/** A state that runs, or before which its container waits. */
export interface ActiveState {
  path: string;
  state: string;
  held: '' | 'paused' | 'breakpoint' | 'confirm'; // '': it runs
  confirm: boolean; // it waits for a confirmation
}
