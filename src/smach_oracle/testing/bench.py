"""Runs a machine under the oracle, with faults and an expert by script, and keeps what happens."""

import contextlib
import functools
import threading
import time
from dataclasses import replace
from types import TracebackType
from typing import TYPE_CHECKING, Any, Iterable, Iterator, List, Mapping, Optional, Tuple, Type

import smach
from smach_oracle.oracle import OracleContainer, oracle_of, unwrap
from smach_oracle.oracle.asking.question import Answer, Expert, Progress, Question
from smach_oracle.oracle.errors import TrialError
from smach_oracle.oracle.identity import remove_identical
from smach_oracle.oracle.records.events import Event, EventKind
from smach_oracle.oracle.scope.background_call import BackgroundCall
from smach_oracle.oracle.scope.scope import Scope
from smach_oracle.oracle.settings.failing_outcomes import FailingNames
from smach_oracle.oracle.settings.interfaces import InterfaceOffer
from smach_oracle.oracle.settings.settings import (
    PreconditionLists,
    Settings,
    SettingsLike,
    as_settings,
)

from .errors import TrialLimitError
from .faults import Fault
from .injection import Injection
from .observed_trial import ObservedTrial, TrialEvidence
from .places import StatePlace, places_of
from .script import AnswerScript, expert, no_answer
from .stopped_clock import StoppedClock
from .trial_text import ProbedStep, TrialStep, place_of

if TYPE_CHECKING:
    from .node_side import NodeSide

LIMIT_S = 60.0
_GRACE_S = 5.0  # from the preempt of a trial that takes too long until it is left behind


class Bench:
    """Runs trials of one machine with faults and an expert by script.

    The machine is wrapped when the bench is made, where it is not wrapped already, and comes out of
    it at `close` or the end of a `with` block. Faults are in it during a trial alone.

    >>> import smach
    >>> from smach_oracle.testing import Bench, expert, fail, supersede
    >>> pick = smach.CBState(lambda userdata: 'succeeded', outcomes=['succeeded', 'aborted'])
    >>> sm = smach.StateMachine(['succeeded', 'aborted'])
    >>> with sm:
    ...     _ = smach.StateMachine.add('PICK', pick)
    >>> with Bench(sm, [fail('PICK', visit=1)]) as bench:
    ...     trial = bench.run().assert_recovered('PICK').assert_not_asked()
    >>> trial.outcome, trial.failures()
    ('succeeded', ['PICK'])
    >>> with Bench(sm, [fail('PICK')], expert=expert(supersede('succeeded'))) as bench:
    ...     bench.run().asked_about()
    ['PICK']
    """

    __test__ = False  # for pytest, which collects classes by their names

    def __init__(
        self,
        machine: smach.StateMachine,
        faults: Iterable[Fault] = (),
        *,
        expert: Optional[Expert] = None,
        settings: SettingsLike = None,
        preconditions: PreconditionLists = None,
        limit_s: float = LIMIT_S,
        ros: bool = False,
        clock: Optional[StoppedClock] = None,
    ) -> None:
        """Put a machine on the bench.

        :param faults: of every trial. See `fail`, `crash`, `hang`, `overrun` and `stub`.
        :param expert: who is asked. See the function `expert`. None: the expert that the machine
            has, else nobody answers, and no time passes. With `ros`: who answers over ROS.
        :param settings: of the oracle, with `preconditions`, as `OracleContainer.wrap` takes them.
            Those of a machine that is wrapped already come back at the end. A `rates_file` is left
            alone.
        :param limit_s: seconds of wall time after which a trial is an error.
        :param ros: attach the machine to its ROS node: events, introspection, `~expert_query`.
        :param clock: by which limits and waits of the oracle go, and waits of faults. None: they go
            by real time.
        :raises FaultError: for a fault that fits no state.
        :raises SettingsError: naming key, value and what is allowed.
        :raises TrialError: for a machine that is wrapped inside another one.
        """
        __tracebackhide__ = True
        self.machine = machine
        self.faults = tuple(faults)
        self._limit_s = limit_s
        self._clock = clock
        self._node = _node_side(machine) if ros else None
        self._was_wrapped = isinstance(machine, OracleContainer)
        if self._was_wrapped and not oracle_of(machine).is_top:
            raise TrialError(
                '{} is wrapped inside another machine; put the top one on the bench'.format(
                    oracle_of(machine).path
                )
            )
        self._settings_before: Optional[Settings] = None  # where others are in force now
        self._put_under(settings, preconditions)
        oracle = oracle_of(machine)
        self._expert_before = oracle.expert
        self._expert = expert or oracle.expert or (None if ros else _silent())
        self._failing = FailingNames(oracle.settings.failing_outcomes)
        try:
            self._injection(self.faults, _TrialNotes(machine, self._failing))  # it checks them
        except ValueError:
            self.close()
            raise

    def _put_under(self, settings: SettingsLike, preconditions: PreconditionLists) -> None:
        checked = as_settings(settings, preconditions)
        container_class = OracleContainer if self._node is None else self._node.container_class
        if not self._was_wrapped:
            container_class.wrap(self.machine, settings=replace(checked, rates_file=''))
            return
        own = oracle_of(self.machine).settings
        wanted = own if settings is None and preconditions is None else checked
        self._use(replace(wanted, rates_file=''))
        if oracle_of(self.machine).settings != own:
            self._settings_before = own

    def _use(self, settings: Settings) -> None:
        """Put settings in force in a machine that is wrapped, where they are others."""
        oracle = oracle_of(self.machine)
        if settings != oracle.settings:
            OracleContainer.wrap(
                self.machine, settings=settings, recover=oracle.recovers, strict=False
            )

    def __enter__(self) -> 'Bench':
        return self

    def __exit__(
        self,
        kind: Optional[Type[BaseException]],
        error: Optional[BaseException],
        traceback: Optional[TracebackType],
    ) -> None:
        self.close()

    def close(self) -> None:
        """Give the machine back: unwrapped, or wrapped as it was before. It runs no more trials."""
        if self._settings_before is not None:
            self._use(self._settings_before)
        elif not self._was_wrapped and isinstance(self.machine, OracleContainer):
            if not self.machine.is_running():  # one that was left behind stays as it is
                if self._node is not None:
                    self._node.leave()
                unwrap(self.machine)

    def run(
        self,
        faults: Optional[Iterable[Fault]] = None,
        userdata: Optional[Mapping[str, Any]] = None,
        parent: Optional[smach.UserData] = None,
    ) -> ObservedTrial:
        """Run one trial, and return what happened.

        What leaves the machine as an exception is in the trial (`error`), not raised. The machine
        runs in a thread of its own.

        :param faults: of this trial, in place of those of the bench.
        :param userdata: put into the userdata of the machine before.
        :param parent: what `execute` is given: the userdata of who executes the machine.
        :raises FaultError: for a fault that fits no state.
        :raises ScriptError: where a question did not go with the script of the expert.
        :raises TrialLimitError: where the trial did not end in time. It was preempted then.
        :raises TrialError: where the machine still runs.
        """
        __tracebackhide__ = True
        if self.machine.is_running():
            raise TrialError('the machine runs already, perhaps since a trial that did not end')
        notes = _TrialNotes(self.machine, self._failing)
        injection = self._injection(self.faults if faults is None else tuple(faults), notes)
        for key, value in (userdata or {}).items():
            self.machine.userdata[key] = value
        script = self._expert if isinstance(self._expert, AnswerScript) else None
        if script is not None:
            script.begin()
        given = () if parent is None else (parent,)
        call = BackgroundCall(
            functools.partial(self.machine.execute, *given), 'smach_oracle test bench'
        )
        with self._watched(notes):
            in_time = self._run_within_limit(call, injection)
        trial = notes.trial(call, injection)
        if not in_time:
            raise TrialLimitError(
                'the trial did not end within {:g} s\n{}'.format(self._limit_s, trial)
            )
        if script is not None:
            script.check(trial)
        return trial

    def _injection(self, faults: Tuple[Fault, ...], notes: '_TrialNotes') -> Injection:
        __tracebackhide__ = True
        return Injection(self.machine, faults, notes.note_probe, self._failing, self._clock)

    @contextlib.contextmanager
    def _watched(self, notes: '_TrialNotes') -> Iterator[None]:
        """Let events and questions go to the notes, and the time by the clock of the bench."""
        oracle = oracle_of(self.machine)
        if self._expert is not None:
            oracle.expert = _NotingExpert(self._expert, notes.questions)
        clock_before = oracle.clock
        if self._clock is not None:
            oracle.clock = self._clock
        observer = notes.note_event
        oracle.events.observers.append(observer)
        try:
            yield
        finally:
            remove_identical(oracle.events.observers, observer)
            oracle.clock = clock_before
            if self._expert is not None:
                oracle.expert = self._expert_before

    def _run_within_limit(self, call: BackgroundCall, injection: Injection) -> bool:
        injection.put_in()
        try:
            call.start()
            if Scope().wait(self._limit_s, call.done):
                return True
            self._stop(call, injection)
            return False
        except BaseException:  # Ctrl-C in the thread of the test
            self._stop(call, injection)
            raise
        finally:
            injection.take_out()

    def _stop(self, call: BackgroundCall, injection: Injection) -> None:
        """Preempt the machine, let go of what hangs, and wait a little for the end."""
        self.machine.request_preempt()
        injection.take_out()
        if not Scope().wait(_GRACE_S, call.done):
            call.leave_behind()


class _TrialNotes:
    """Notes on one trial, in the order in which things happen. Threads may note at once."""

    def __init__(self, machine: smach.StateMachine, failing: FailingNames) -> None:
        self.questions: List[Question] = []
        self._states = tuple(place.path for place in places_of(machine))
        self._failing = failing
        self._lock = threading.Lock()
        self._steps: List[TrialStep] = []

    def note_event(self, event: Event) -> None:
        """Observe the oracle."""
        with self._lock:
            self._steps.append(event)

    def note_probe(self, place: StatePlace, visit: int, what: str, text: str) -> None:
        """Note what the injection saw."""
        failing = what == 'raised' or (what == 'ended' and text in self._failing)
        with self._lock:
            self._steps.append(
                ProbedStep(place.path, visit, what, text, time.time(), failing=failing)
            )

    def trial(self, call: BackgroundCall, injection: Injection) -> ObservedTrial:
        """Return the trial, of a call that has ended or was left behind."""
        with self._lock:
            steps = list(self._steps)
        told = {
            place_of(step)
            for step in steps
            if isinstance(step, Event) and step.kind is EventKind.STATE_START
        }
        steps = [
            step._replace(told=step.path in told) if isinstance(step, ProbedStep) else step
            for step in steps
        ]
        ended = call.done.is_set() and call.error is None
        return ObservedTrial(
            TrialEvidence(
                str(call.result) if ended and call.result is not None else None,
                call.error,
                steps,
                tuple(self.questions),
                [
                    armed.fault
                    for armed in injection.armed
                    if not (armed.happened or armed.fault.is_stub)
                ],
                self._states,
                self._failing,
            )
        )


class _NotingExpert(Expert):
    """Notes the questions, and leaves the answers to another."""

    def __init__(self, inner: Expert, questions: List[Question]) -> None:
        self._inner = inner
        self._questions = questions

    def ask(
        self, question: Question, cancelled: threading.Event, progress: Progress
    ) -> Optional[Answer]:
        self._questions.append(question)
        return self._inner.ask(question, cancelled, progress)

    def run_interface(
        self,
        offer: InterfaceOffer,
        question: Question,
        cancelled: threading.Event,
        progress: Progress,
    ) -> Optional[Answer]:
        return self._inner.run_interface(offer, question, cancelled, progress)


def _node_side(machine: smach.StateMachine) -> 'NodeSide':
    from .node_side import NodeSide

    return NodeSide(machine)


def _silent() -> AnswerScript:
    """Return an expert who never answers."""
    return expert(lambda question: no_answer())
