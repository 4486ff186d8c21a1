"""The way to where a trial stands: the latest visits of each container it is in. Pure.

It is derived from the trial's events alone. A question has the visits of its own container only,
as its robot knows them. This has those of the containers around.
"""

from collections import OrderedDict, deque
from typing import Deque, Dict, Final, List, NamedTuple, Set, Tuple

from smach_oracle.analysis.replaying.followed import Preempts
from smach_oracle.oracle.records.events import Event, EventKind, FailureKind
from smach_oracle.oracle.records.facts import UNCOUNTED, branches_of, last_stored
from smach_oracle.oracle.records.short_text import shortened
from smach_oracle.oracle.records.visits import Visit, VisitResult

from ..shapes.questions import Missing
from .recovery_statistics import takes_out

MOST_VISITS = 24  # of a container
MOST_LEVELS = 32  # of a trial
MOST_TRIALS = 100
_MOST_PATHS = 200  # that are remembered after a gap
_LONGEST = 200
# why visits are missing before those that are known
UNHEARD: Final = 'unheard'
OLDER: Final = 'older'


class Level(NamedTuple):
    """A container around, the state of it that runs, and the visits before that, oldest first."""

    path: str
    state: str
    visits: Tuple[Visit, ...]
    missing: Missing  # '' where none is missing before these


class _RunningContainer:
    """A container that runs."""

    def __init__(self, missing: Missing, branches: Tuple[str, ...] = ()) -> None:
        self.visits: Deque[Visit] = deque(maxlen=MOST_VISITS)
        self.missing: Missing = missing
        self.branches = branches  # states with visits of their own, as those of a Concurrence
        self.begun: Set[str] = set()  # states whose visit has not ended
        self.preempts = Preempts()

    def add(self, event: Event, result: VisitResult) -> None:
        if len(self.visits) == MOST_VISITS:
            self.missing = self.missing or OLDER
        self.visits.append(
            Visit(shortened(event.state, _LONGEST), shortened(event.outcome, _LONGEST), result)
        )

    def forget(self) -> None:
        """Events were not heard: what is known is no whole way."""
        self.visits.clear()
        self.begun.clear()
        self.missing = UNHEARD


class TrialWay:
    """The way of one trial. Its events are added in the order of their numbers."""

    def __init__(self) -> None:
        self._containers: Dict[str, _RunningContainer] = {}
        self._last_seq = -1
        # once events are missing, or the trial has gone on after a stop, a container that begins
        # may be one that has run before. It is new where the one around has moved on since
        self._may_go_on = False
        self._moved: Set[str] = set()

    def add(self, event: Event) -> None:
        """Take in one event."""
        self._look_for_gap(event)
        self._last_seq = event.seq
        if event.kind == EventKind.TRIAL_START:
            self._containers.clear()
        elif event.kind == EventKind.CONTAINER_START:
            self._begin(event)
        elif event.kind == EventKind.CONTAINER_END:
            if event.outcome:  # else its program is being stopped, and the trial may go on
                self._drop(event.path)
        elif event.kind == EventKind.JUMP:
            self._note_moved(event.path)
        elif event.path in self._containers:
            self._take(event, self._containers[event.path])

    def above(self, path: str) -> List[Level]:
        """Return the containers around one, the outermost first.

        :param path: of the container that is meant, such as KITCHEN/FETCH.
        """
        labels = path.split('/')[: MOST_LEVELS + 1]
        return [
            self._level('/'.join(labels[:depth]), labels[depth]) for depth in range(1, len(labels))
        ]

    def _level(self, path: str, state: str) -> Level:
        found = self._containers.get(path)
        if found is None:  # a Concurrence of containers tells nothing of itself
            below = self._containers.get('{}/{}'.format(path, state))
            return Level(path, state, (), below.missing and UNHEARD if below else UNHEARD)
        own = state if state in found.branches else ''
        visits = [visit for visit in found.visits if not own or visit.state == own]
        return Level(path, state, tuple(visits), found.missing)

    def _look_for_gap(self, event: Event) -> None:
        """Notice that events are missing. A trial that has gone on numbers on with a gap."""
        resumed = event.kind == EventKind.RESUMED
        lost = last_stored(event) > self._last_seq if resumed else event.seq > self._last_seq + 1
        if lost:
            for container in self._containers.values():
                container.forget()
        if lost or resumed:
            self._may_go_on = True
            self._moved.clear()

    def _begin(self, event: Event) -> None:
        path = event.path
        if self._may_go_on and self._around(path) not in self._moved:
            if path not in self._containers:
                self._put(path, _RunningContainer(UNHEARD, _branches(event)))
            return
        self._drop(path)
        self._put(path, _RunningContainer('', _branches(event)))
        self._note_moved(path)

    def _around(self, path: str) -> str:
        """Return the path of the container around, '' where none is known."""
        around = path.rpartition('/')[0]
        while around and around not in self._containers:
            around = around.rpartition('/')[0]
        return around

    def _put(self, path: str, container: _RunningContainer) -> None:
        if len(self._containers) < MOST_LEVELS and len(path) <= MOST_LEVELS * _LONGEST:
            self._containers[path] = container

    def _take(self, event: Event, container: _RunningContainer) -> None:
        """Take in what happens to a state."""
        state = event.state
        container.preempts.take(event)
        if event.kind == EventKind.STATE_START:
            if len(container.begun) < _MOST_PATHS:
                container.begun.add(state)
        elif event.kind == EventKind.FAILURE:
            if event.failure_kind != FailureKind.INTERRUPTED:
                container.add(event, VisitResult.FAILURE)
            self._end(event, container)
        elif event.kind == EventKind.TRANSITION:
            if state in container.begun and event.text != UNCOUNTED['text']:
                success = container.preempts.is_success(event)
                container.add(event, VisitResult.SUCCESS if success else VisitResult.PREEMPTED)
            self._end(event, container)
        elif event.kind == EventKind.QUERY_ANSWERED:
            if takes_out(event) and state in container.begun:  # it still runs
                container.add(event._replace(outcome=''), VisitResult.PREEMPTED)
                self._end(event, container)
        elif event.kind == EventKind.SUPERSEDE:
            if container.visits and container.visits[-1].state == state:
                container.visits.pop()
            container.add(event, VisitResult.SUPERSEDED)
            self._end(event, container)

    def _end(self, event: Event, container: _RunningContainer) -> None:
        """A visit is over, and with it all that ran in the state."""
        container.begun.discard(event.state)
        self._note_moved(event.path)
        self._drop('{}/{}'.format(event.path, event.state))

    def _drop(self, path: str) -> None:
        below = path + '/'
        for each in [each for each in self._containers if each == path or each.startswith(below)]:
            del self._containers[each]

    def _note_moved(self, path: str) -> None:
        if self._may_go_on and len(self._moved) < _MOST_PATHS:
            self._moved.add(path)


def _branches(event: Event) -> Tuple[str, ...]:
    return branches_of(event)[:_MOST_PATHS]


class TrialWays:
    """The ways of the trials that events were heard of last."""

    def __init__(self) -> None:
        self._ways: 'OrderedDict[str, TrialWay]' = OrderedDict()

    def add(self, event: Event) -> None:
        """Take in one event of any trial."""
        way = self._ways.get(event.trial_id)
        if way is None:
            way = self._ways[event.trial_id] = TrialWay()
            if len(self._ways) > MOST_TRIALS:
                self._ways.popitem(last=False)
        self._ways.move_to_end(event.trial_id)
        way.add(event)

    def above(self, trial_id: str, path: str) -> List[Level]:
        """Return the containers around one of a trial, the outermost first."""
        return self._ways.get(trial_id, _NOT_HEARD).above(path)


_NOT_HEARD = TrialWay()
