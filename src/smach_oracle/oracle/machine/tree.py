"""The tree of one wrapped machine: what all its containers share.

These are the trial, its events, the expert and the threads that were left behind.
"""

import itertools
import threading
import uuid
from contextlib import nullcontext
from typing import Any, Callable, ContextManager, Dict, Mapping, Optional, Set, Tuple, Type

import smach
from smach_oracle import forking

from ..asking.question import Expert
from ..control.control import Control
from ..records.early_end import EarlyEnd, Restarts
from ..records.events import EventSource
from ..scope.alarm_clock import AlarmClock
from ..scope.clock import Clock, TreeClock
from ..scope.scope import Reason, Scope, Waiting
from ..settings.health import HealthFunction
from ..smach_private import KnownClasses
from .health_watch import HealthWatch
from .resumed import ResumedTrial
from .trial_budget import TrialBudget
from .workers import Workers


def log_error(text: str) -> None:
    """Log to whatever SMACH logs to now."""
    smach.logerr(text)


def no_description(state: smach.State) -> str:
    """States say nothing of a failure by outcome, unless somebody knows how to ask them."""
    return ''


# a context in which a machine has its trial
AroundTrial = Callable[[smach.StateMachine], ContextManager[None]]


def nothing_around(machine: smach.StateMachine) -> ContextManager[None]:
    """Nobody needs to know of a trial, unless the tree is attached to a node."""
    return nullcontext()


def no_store() -> None:
    """Nothing is kept."""


def new_id() -> str:
    """Return an id that nobody else uses."""
    return uuid.uuid4().hex[:12]


class Tree:
    """Shared by the top machine and all wrapped containers below it."""

    def __init__(
        self,
        container_class: Type[smach.StateMachine],
        recover: bool,
        expert: Optional[Expert] = None,
        health: Optional[HealthFunction] = None,
    ) -> None:
        # that of wrapped machines, and what nested ones become
        self.container_class = container_class
        self.recover = recover
        self.events = EventSource(log_error)
        self.trials = 0  # begun
        # whether a state is guarded (`on_retry`), so that visits are numbered
        self.numbers_visits = False
        self.trial_id = ''
        self.is_resumed = False  # whether the trial goes on after its program was stopped
        self.rates_loaded = ''  # the rates file read last
        self._questions: int  # in this trial
        self._said: Set[Tuple[str, ...]] = set()  # in this trial
        self._said_for_good: Set[str] = set()
        self.process = forking.process
        self.be_at_rest(expert, health)

    def be_at_rest(
        self, expert: Optional[Expert] = None, health: Optional[HealthFunction] = None
    ) -> None:
        """Have nothing under way, nothing asked by an operator, and locks that nobody holds."""
        clock = self.clock = TreeClock(Clock())
        self._visits = itertools.count(1)
        self.expert = expert
        # has a store keep which states have begun, at once, where there is no event of it
        self.keep_marks: Callable[[], None] = no_store
        # what a state that failed by outcome says of it
        self.describe_failure: Callable[[smach.State], str] = no_description
        # what is to be done around a trial of a nested machine that is executed by itself
        self.around_nested_trial: AroundTrial = nothing_around
        # ids of containers and states that are executed as preconditions now
        self._preconditions: Set[Tuple[int, int]] = set()
        self.restarts, self.resumed = Restarts(), ResumedTrial()
        self.classes = KnownClasses()
        self.scope = Scope(
            look=lambda: Reason.SHUTDOWN if smach.is_shutdown() else None, clock=clock
        )
        self.workers = Workers(clock)
        self.budget = TrialBudget(clock)
        self.early_end = EarlyEnd(self.scope)
        self.waiting: Waiting = Waiting()
        self.health = HealthWatch(health)
        self.alarms = AlarmClock(clock)
        self.control = Control(clock)
        self.rates_lock = threading.Lock()
        self.departures_lock = threading.Lock()
        self._lock = threading.Lock()

    def take_over(self, other: 'Tree') -> None:
        """Ask the expert and the health function of another tree, where this one has none."""
        if self.expert is None:
            self.expert = other.expert
        if self.health.given is None:
            self.health.given = other.health.given

    def is_parents(self) -> bool:
        """Whether this is a child process of the program to which the tree belongs."""
        return self.process != forking.process and forking.is_child()

    def silent_twin(self) -> 'Tree':
        """Return a tree for the same machines in a child process, with nothing of this one."""
        twin = Tree(self.container_class, recover=False)
        twin.trial_id, twin.process = self.trial_id, self.process
        return twin

    def begin_trial(self, trial_id: str) -> None:
        """Number events and questions again. The first event is still to come."""
        self.trial_id = trial_id
        self.trials += 1
        self.is_resumed = False
        self.resumed = ResumedTrial()
        self._questions = 0
        self._said.clear()
        self.classes.clear()
        self.events.begin_trial(trial_id, is_silent=True)

    def is_new(self, *about: str) -> bool:
        """Whether something has not been said in this trial. It may come at each visit."""
        with self._lock:
            is_new = about not in self._said
            self._said.add(about)
            return is_new

    def warn_for_good(self, text: str) -> None:
        """Warn of what stays so, once."""
        if text not in self._said_for_good:
            self._said_for_good.add(text)
            smach.logwarn(text)

    def go_on_counting(self, visits: int, whole: Mapping[str, Any]) -> None:
        """Number visits behind `visits`, and go on with what the stored trial had spent.

        A machine that was paused is paused again.
        """
        self.is_resumed = True
        self._visits = itertools.count(visits + 1)
        self._questions = int(whole.get('questions', 0))
        self.budget.go_on(whole.get('budget'))
        self.restarts.count = int(whole.get('restarts', 0))
        self.pause_as_stored(whole)

    def pause_as_stored(self, whole: Mapping[str, Any]) -> bool:
        """Pause a machine that was paused in a stored trial. Return whether it was."""
        paused, by = whole.get('paused') or (False, '')
        if paused:
            self.control.pause(by)
        return bool(paused)

    def spent(self) -> Dict[str, Any]:
        """Return what a trial that goes on needs of what is spent or asked, as plain data."""
        count = self.restarts.count
        return {
            'questions': self._questions,
            'budget': self.budget.spent(),
            'paused': [self.control.paused, self.control.paused_by],
            **({'restarts': count} if count else {}),
        }

    def begin_precondition(self, node: object, state: smach.State) -> bool:
        """Note that a state is executed as a precondition. Return False where it is so already."""
        with self._lock:
            is_free = not self.is_precondition(node, state)
            self._preconditions.add((id(node), id(state)))
            return is_free

    def end_precondition(self, node: object, state: smach.State) -> None:
        """Note that it has ended."""
        with self._lock:
            self._preconditions.discard((id(node), id(state)))

    def is_precondition(self, node: object, state: object) -> bool:
        """Whether a state of a container is executed as a precondition now."""
        return (id(node), id(state)) in self._preconditions

    def next_visit(self) -> int:
        """Return the number of the next visit of a state, in whichever container."""
        return next(self._visits)

    def next_question_id(self) -> str:
        """Return the id of the next question.

        Each is new, also when it is asked about the same failure.
        """
        with self._lock:
            self._questions += 1
            return '{}-{}'.format(self.trial_id or new_id(), self._questions)

    def __getstate__(self) -> Dict[str, object]:
        """Leave out what cannot travel with a pickled or copied machine.

        That is the expert, its connection, a clock that was handed in, locks, all that is under
        way and all that an operator has asked.
        """
        at_rest = Tree.__new__(Tree)
        at_rest.be_at_rest()
        return {key: value for key, value in vars(self).copy().items() if key not in vars(at_rest)}

    def __setstate__(self, state: Dict[str, object]) -> None:
        self.__dict__.update(state)
        self.be_at_rest()
