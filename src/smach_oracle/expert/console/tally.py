"""Counts one trial as its events come in, by the definitions of doc/statistics.md, as the analysis of bags does."""
from collections import Counter
from typing import Any, Dict, Iterable, List, Set, Tuple

from ...oracle.events import NO_OUTCOME, Event, EventKind
from ...oracle.naming import PREEMPTED, FailingNames

ENDINGS = ('success', 'failure', 'preempted')
COUNTED = ('failures', 'recoveries', 'questions', 'answered')
_AUTONOMOUS = ('revisit', 'step_back')
_STOPPED_BY = ('KeyboardInterrupt:', 'SystemExit:')
_FAILING = FailingNames()


class Tally:
    """The counts of one trial so far."""

    def __init__(self, first: Event) -> None:
        self.trial_id = first.trial_id
        self.experiment = first.path.strip('/').split('/')[0]
        self.start_s = first.wall_time
        self.end_s = first.wall_time
        self.ending = ''  # '' while it runs
        self.outcome = ''
        self.recovers = True
        self.failures = 0
        self.recoveries = 0
        self.received = 0
        self._last_seq = -1
        self._asked: Set[str] = set()
        self._answered: Set[str] = set()
        self._decided: Dict[str, bool] = {}
        self._began = False

    @property
    def questions(self) -> int:
        """Questions put to the expert."""
        return len(self._asked)

    @property
    def answered(self) -> int:
        """Questions of these that were answered."""
        return len(self._asked & self._answered)

    @property
    def lost(self) -> int:
        """Events that are missing: lost, or from before this console heard of the trial."""
        return self._last_seq + 1 - self.received

    def add(self, event: Event) -> None:
        """Count one event."""
        self.received += 1
        self._last_seq = max(self._last_seq, event.seq)
        self.start_s = min(self.start_s, event.wall_time)
        self.end_s = max(self.end_s, event.wall_time)
        if event.kind == EventKind.TRIAL_START:
            self.recovers = (event.data or {}).get('recovers') is not False
        elif event.kind == EventKind.STATE_START:
            self._began = True
        elif event.kind == EventKind.QUERY_ANSWERED:
            self._answered.add(event.query_id)
        elif event.kind == EventKind.TRIAL_END:
            self.outcome = event.outcome
            self.ending = self._ending(event)
        self._count_recovery(event)

    def _count_recovery(self, event: Event) -> None:
        """A decision to revisit or to step back counts when the next jump of its container carries it out."""
        if event.kind == EventKind.DECISION:
            self._decided[event.path] = event.outcome in _AUTONOMOUS
        elif event.kind == EventKind.JUMP:
            self.recoveries += self._decided.pop(event.path, False)
        elif event.kind in (EventKind.QUERY_OPENED, EventKind.FAILURE, EventKind.GIVE_UP):
            self._decided[event.path] = False
            self.failures += event.kind == EventKind.FAILURE
            if event.kind == EventKind.QUERY_OPENED:
                self._asked.add(event.query_id)

    def _ending(self, end: Event) -> str:
        stopped = end.text.startswith(_STOPPED_BY) or (end.text == NO_OUTCOME and self._began)
        if end.outcome.lower() == PREEMPTED or (not end.outcome and stopped):
            return 'preempted'
        return 'failure' if not end.outcome or end.outcome in _FAILING else 'success'


def table(tallies: Iterable[Tally]) -> List[Dict[str, Any]]:
    """The counts of Table I, by experiment and arm, over the trials that have ended: in how many of them each happened
    at least once, and how often in all."""
    groups: Dict[Tuple[str, bool], List[Tally]] = {}
    for tally in tallies:
        if tally.ending:
            groups.setdefault((tally.experiment, tally.recovers), []).append(tally)
    rows = []
    for (experiment, recovers), members in sorted(groups.items(), key=lambda item: (item[0][0], not item[0][1])):
        endings = Counter(tally.ending for tally in members)
        rows.append({'experiment': experiment, 'oracle': recovers, 'runs': len(members),
                     'endings': {name: endings[name] for name in ENDINGS},
                     'counts': {name: _count([getattr(tally, name) for tally in members]) for name in COUNTED}})
    return rows


def _count(numbers: List[int]) -> Dict[str, int]:
    return {'trials': sum(1 for number in numbers if number), 'events': sum(numbers)}
