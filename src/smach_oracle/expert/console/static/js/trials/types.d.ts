// Shapes of trials that are replayed.
import { ByPath, ByState, Graph, KeptImage, TrialEvent } from '../server';
import { ShownRate } from '../robots/types';

export as namespace replay;

/** What is replayed. */
export interface ReplayedTrial {
  id: string;
  events: TrialEvent[]; // so far
  end: number; // of the time axis, s since the epoch
  running: boolean; // more is to come
  graph(path: string): Graph | undefined;
  images: { [query: string]: KeptImage[] | undefined }; // what cameras gave at its questions
  replays: { [seq: string]: number | undefined }; // of what came before its failures
}

/** How often a transition was taken; from null: the oracle, whose label the graph knows. */
export interface Taken { from: string | null; outcome: string; to: string; times: number }

/** A question of a trial, as it stands at a moment. */
export interface AskedQuestion {
  query: string;
  state: string;
  reason: string;
  holder: string;
  steps: string[]; // of interfaces, in words
  answer: { kind: string; target: string; by: string; why: string } | null;
  closed: string; // why it was not answered
}

/** A trial at a moment. */
export interface Snapshot {
  active: ByPath<string>;
  asked: ByPath<boolean>; // the oracle is at work
  latest: ByPath<[from: string, to: string]>;
  failed: ByPath<{ state: string }>;
  rates: ByPath<ByState<ShownRate>>;
  taken: ByPath<Map<string, Taken>>;
  failure: number; // of the latest one: the number of its event; -1 before any
  question: AskedQuestion | null;
}

/** On the time axis: a state that runs, or a question that is open. */
export interface Bar { lane: string; from: number; to: number; kind: string; words: string }
