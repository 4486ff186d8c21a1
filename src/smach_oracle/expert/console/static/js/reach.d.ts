// Whom the console calls about open questions.
import { ByKey } from './server';

export interface Reach {
  calls: ByKey<Call[]>;
  next: ByKey<NextCall>;
  failed: { to: string; question: string; why: string; at: number }[]; // the newest last
}

export interface Call {
  to: string; // person, and how
  status: 'waiting' | 'sent' | 'failed' | 'dropped';
  why: string; // it is not there yet, or never will be
  at: number;
}

export interface NextCall { people: string[]; at: number }
