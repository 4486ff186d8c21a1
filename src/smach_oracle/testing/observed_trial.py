"""One trial as a test saw it, with assertions that read as sentences."""

from typing import Iterable, List, NamedTuple, Optional, Sequence

from smach_oracle.oracle.asking.question import Question
from smach_oracle.oracle.records.events import Event, EventKind
from smach_oracle.oracle.settings.failing_outcomes import FailingNames, is_preempted

from .faults import Fault
from .trial_text import ProbedStep, TrialStep, jump_from, jump_to, lines_of, place_of


class TrialEvidence(NamedTuple):
    """Everything that a bench has seen of one trial."""

    outcome: Optional[str]  # of the machine. None means it has none
    error: Optional[BaseException]  # what left the machine
    steps: Sequence[TrialStep]
    questions: Sequence[Question] = ()
    unused_faults: Sequence[Fault] = ()  # they were to happen, and did not
    states: Sequence[str] = ()  # all of the machine, PATH/LABEL. () means not known
    failing: FailingNames = FailingNames()


class ObservedTrial:
    """One trial of a machine, with assertions about what happened in it.

    Its assertions take states as LABEL or PATH/LABEL, the path below the top machine. One that
    fails shows the course of the trial, as `str` does. Each returns the trial itself.
    """

    def __init__(self, seen: TrialEvidence) -> None:
        self._seen = seen
        self.outcome = seen.outcome
        self.error = seen.error
        self.questions = tuple(seen.questions)  # as the expert was asked them, in the process
        self.unused_faults = tuple(seen.unused_faults)
        self.events = tuple(step for step in seen.steps if isinstance(step, Event))

    # -- what happened

    def visits(self) -> List[str]:
        """Return the states that were entered, PATH/LABEL, in order.

        Ends in between are left out.
        """
        return [self._path(step) for step in self._seen.steps if _is_entry(step)]

    def failures(self) -> List[str]:
        """Return the states that failed, PATH/LABEL, once for each failure."""
        return [self._path(step) for step in self._seen.steps if _is_failure(step)]

    def asked_about(self) -> List[str]:
        """Return the states that the expert was asked about, once for each question."""
        return self._states_of(EventKind.QUERY_OPENED)

    @property
    def duration_s(self) -> float:
        """Return the seconds of wall time from the first to the last thing that happened."""
        steps = self._seen.steps
        return max(0.0, steps[-1].wall_time - steps[0].wall_time) if steps else 0.0

    @property
    def decisions(self) -> List[str]:
        """Return the sentences of all decisions."""
        return [event.text for event in self.events if event.kind is EventKind.DECISION]

    @property
    def gave_up(self) -> bool:
        """Whether the oracle of the top machine gave up."""
        return any(
            event.kind is EventKind.GIVE_UP and '/' not in event.path and not event.target
            for event in self.events
        )

    @property
    def ended_well(self) -> bool:
        """Whether the machine ended in an outcome that is not named like a failure."""
        return (
            self.error is None
            and self.outcome is not None
            and not self.gave_up
            and self.outcome not in self._seen.failing
            and not is_preempted(self.outcome)
        )

    def __str__(self) -> str:
        lines = [
            'The trial {}. {}, {}.'.format(
                self.ending(),
                _counted(len(self.failures()), 'failure'),
                _counted(len(self.asked_about()), 'question'),
            )
        ]
        lines += lines_of(self._seen.steps)
        lines += ['  a fault that did not happen: {}'.format(fault) for fault in self.unused_faults]
        return '\n'.join(lines)

    # -- assertions

    def assert_ended_with(self, outcome: str) -> 'ObservedTrial':
        """Fail unless the machine ended in this outcome.

        :raises AssertionError: with the course of the trial.
        """
        __tracebackhide__ = True
        return self._require(
            self.error is None and self.outcome == outcome,
            'the trial was to end in {!r}, and it {}'.format(outcome, self.ending()),
        )

    def assert_raised(self, kind: type) -> 'ObservedTrial':
        """Fail unless an exception of this type left the machine.

        :raises AssertionError: with the course of the trial.
        """
        __tracebackhide__ = True
        return self._require(
            isinstance(self.error, kind),
            'the trial was to raise {}, and it {}'.format(kind.__name__, self.ending()),
        )

    def assert_took_less_than(self, seconds: float) -> 'ObservedTrial':
        """Fail unless the trial took less wall time.

        :raises AssertionError: with the course of the trial.
        """
        __tracebackhide__ = True
        return self._require(
            self.duration_s < seconds,
            'the trial was to take less than {:g} s, and it took {:.2f} s'.format(
                seconds, self.duration_s
            ),
        )

    def assert_recovered(self, state: str = '') -> 'ObservedTrial':
        """Fail unless a state (any, if left out) failed, and the trial still ended well.

        It ended well where the oracle did not give up and the outcome of the machine is neither
        `preempted` nor named like a failure.

        :raises AssertionError: with the course of the trial.
        """
        __tracebackhide__ = True
        if not self._count(self.failures(), state):
            self._fail(
                '{} was to fail and to recover, and {}'.format(
                    state or 'a state', 'it did not fail' if state else 'nothing failed'
                )
            )
        return self._require(
            self.ended_well,
            'the trial was to recover{}, and it {}'.format(
                ' from the failure of ' + state if state else '', self.ending()
            ),
        )

    def assert_failed(self, state: str, times: Optional[int] = None) -> 'ObservedTrial':
        """Fail unless a state failed, so many times if that is given.

        :raises AssertionError: with the course of the trial.
        """
        __tracebackhide__ = True
        return self._require_count(
            '{} was to fail'.format(state),
            'it failed',
            'it did not',
            times,
            self._count(self.failures(), state),
        )

    def assert_no_failures(self) -> 'ObservedTrial':
        """Fail where a state failed.

        :raises AssertionError: with the course of the trial.
        """
        __tracebackhide__ = True
        return self._require(
            not self.failures(),
            'nothing was to fail, and these did: {}'.format(', '.join(self.failures())),
        )

    def assert_asked_about(self, state: str, times: Optional[int] = None) -> 'ObservedTrial':
        """Fail unless the expert was asked about a state, so many times if that is given.

        :raises AssertionError: with the course of the trial.
        """
        __tracebackhide__ = True
        return self._require_count(
            'the expert was to be asked about {}'.format(state),
            'was asked',
            'was not',
            times,
            self._count(self.asked_about(), state),
        )

    def assert_not_asked(self, state: str = '') -> 'ObservedTrial':
        """Fail where the expert was asked, about a state or at all.

        :raises AssertionError: with the course of the trial.
        """
        __tracebackhide__ = True
        return self._require(
            not self._count(self.asked_about(), state),
            'the expert was not to be asked{}, and was asked about {}'.format(
                ' about ' + state if state else '', ', '.join(self.asked_about())
            ),
        )

    def assert_visited(self, states: Iterable[str], exactly: bool = False) -> 'ObservedTrial':
        """Fail unless the trial entered these states in this order.

        Others may lie between them, before and after. With `exactly` none may: then the states of
        all containers are given, each container before its states.

        :raises AssertionError: with the course of the trial.
        """
        __tracebackhide__ = True
        wanted = [states] if isinstance(states, str) else list(states)
        for state in wanted:
            self._check_name(state)
        visits = self.visits()
        return self._require(
            _same(visits, wanted) if exactly else _in_order(visits, wanted),
            'the trial was to visit {}{}, and it visited {}'.format(
                'exactly ' if exactly else '',
                ', '.join(wanted) or 'nothing',
                ', '.join(visits) or 'nothing',
            ),
        )

    def assert_not_visited(self, state: str) -> 'ObservedTrial':
        """Fail where the trial entered a state.

        :raises AssertionError: with the course of the trial.
        """
        __tracebackhide__ = True
        return self._require(
            not self._count(self.visits(), state),
            '{} was not to be visited, and it was'.format(state),
        )

    def assert_jumped(self, state: str, to: str) -> 'ObservedTrial':
        """Fail unless the oracle went from a failed state to another (or the same) one.

        Either may be in any container of the tree.

        :raises AssertionError: with the course of the trial.
        """
        __tracebackhide__ = True
        self._check_name(state)
        jumps = [event for event in self.events if event.kind is EventKind.JUMP]
        return self._require(
            any(
                _is_named(jump_from(event), state) and _is_named(jump_to(event), to)
                for event in jumps
            ),
            'the oracle was to go from {} to {}; its jumps: {}'.format(
                state,
                to,
                ', '.join('{} to {}'.format(jump_from(event), jump_to(event)) for event in jumps)
                or 'none',
            ),
        )

    def assert_all_faults_happened(self) -> 'ObservedTrial':
        """Fail where a fault did not happen, since its state or its visit was not reached.

        :raises AssertionError: with the course of the trial.
        """
        __tracebackhide__ = True
        return self._require(
            not self.unused_faults,
            'all faults were to happen, and these did not: {}'.format(
                '; '.join(map(str, self.unused_faults))
            ),
        )

    # -- inside

    def _require(self, holds: bool, sentence: str) -> 'ObservedTrial':
        __tracebackhide__ = True
        if not holds:
            self._fail(sentence)
        return self

    def _require_count(
        self, wanted: str, done: str, not_done: str, times: Optional[int], count: int
    ) -> 'ObservedTrial':
        __tracebackhide__ = True
        if times is None:
            return self._require(count > 0, '{}, and {}'.format(wanted, not_done))
        return self._require(
            count == times, '{} {}, and {} {}'.format(wanted, _times(times), done, _times(count))
        )

    def _fail(self, sentence: str) -> None:
        __tracebackhide__ = True
        raise AssertionError('{}\n{}'.format(sentence, self))

    def _count(self, places: List[str], state: str) -> int:
        __tracebackhide__ = True
        if state:
            self._check_name(state)
        return sum(1 for place in places if not state or _is_named(place, state))

    def _check_name(self, state: str) -> None:
        """Refuse a state that does not exist: nothing is ever true of it."""
        __tracebackhide__ = True
        if self._seen.states and not any(_is_named(path, state) for path in self._seen.states):
            raise AssertionError(
                'there is no state {!r}; there are {}'.format(state, ', '.join(self._seen.states))
            )

    def _states_of(self, kind: EventKind) -> List[str]:
        return [place_of(event) for event in self.events if event.kind is kind]

    def ending(self) -> str:
        """Return how the machine ended, as the end of a sentence."""
        if self.error is not None:
            text = str(self.error).strip().splitlines()
            return 'raised {}: {}'.format(type(self.error).__name__, text[-1] if text else '')
        if self.outcome is None:
            return 'has no outcome'
        return 'ended in {!r}{}'.format(self.outcome, ' after giving up' if self.gave_up else '')

    @staticmethod
    def _path(step: TrialStep) -> str:
        return step.path if isinstance(step, ProbedStep) else place_of(step)


def _is_entry(step: TrialStep) -> bool:
    if isinstance(step, ProbedStep):
        return step.what == 'entered' and not step.told
    return step.kind is EventKind.STATE_START


def _is_failure(step: TrialStep) -> bool:
    if isinstance(step, ProbedStep):
        return step.failing and not step.told
    return step.kind is EventKind.FAILURE


def _is_named(path: str, name: str) -> bool:
    return path == name or path.endswith('/' + name) or path == name.partition('/')[2]


def _same(visits: Sequence[str], wanted: Sequence[str]) -> bool:
    return len(visits) == len(wanted) and all(map(_is_named, visits, wanted))


def _in_order(visits: Sequence[str], wanted: Sequence[str]) -> bool:
    left = iter(visits)  # each name goes on where the one before was found
    return all(any(_is_named(visit, name) for visit in left) for name in wanted)


def _counted(count: int, what: str) -> str:
    return '{} {}{}'.format(count, what, '' if count == 1 else 's')


def _times(count: int) -> str:
    return _counted(count, 'time')
