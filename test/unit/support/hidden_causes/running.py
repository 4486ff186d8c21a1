"""Machines run under a policy by the real executive, in a time of their own."""

import contextlib
from typing import Any, Iterator, List, Mapping, NamedTuple, Optional, Tuple
from unittest import mock

from fake_clock import FakeClock

import smach
from smach_oracle.oracle import OracleContainer, oracle_of
from smach_oracle.oracle.decision.policies import POLICIES
from smach_oracle.oracle.decision.policy import Policy
from smach_oracle.oracle.machine import tree
from smach_oracle.oracle.records.events import Event, EventKind

from .building import Scene, build, keys_of
from .causes import draw_causes
from .drawing import draw
from .mix import MIX, Mix
from .orders import ASK, GIVE_UP, Arm
from .person import Person
from .plan import DONE, TOP, Box
from .world import Causes, World

TRUE, FALSE, FAILED, CUT_OFF = 'true success', 'false success', 'failed', 'cut off'
# the bed that a machine runs in, whatever its policy. A person takes minutes of a clock that no
# deadline goes by here, and no state runs for longer than its work takes
BED = {'deadline_s': 0, 'still_running_s': 0}
NO_SETTINGS: Mapping[str, Any] = {}


class Trial(NamedTuple):
    """What became of one trial, and what it cost."""

    ended: str
    failures: int  # of states, by the world
    questions: int
    attempts: int  # decisions of the oracle that asked nobody and did not give up
    robot_min: float
    expert_min: float
    harm: int
    streaks: int = 0  # of attempts, under a policy that goes by ways

    @property
    def is_failing(self) -> bool:
        """Whether a state failed."""
        return self.failures > 0

    @property
    def is_lost(self) -> bool:
        """Whether its work was not done, whatever the machine said."""
        return self.ended != TRUE

    @property
    def needed_person(self) -> bool:
        """Whether a person had to act, in the trial or after it."""
        return self.questions > 0 or self.is_lost


def run_machine(
    seed: int,
    arm: Arm,
    trials: int,
    mix: Mix = MIX,
    settings: Mapping[str, Any] = NO_SETTINGS,
) -> Tuple[Trial, ...]:
    """Run the machine of a seed under a policy, one trial after the other."""
    box = draw(seed)
    with Bed(box, draw_causes(seed, box, mix), arm.policy(seed), mix, settings) as bed:
        return tuple(bed.trial(number) for number in range(trials))


class Bed:
    """One machine in its world, wrapped by one line, where a policy is given."""

    def __init__(
        self,
        box: Box,
        causes: Causes,
        policy: Optional[Policy],
        mix: Mix = MIX,
        settings: Mapping[str, Any] = NO_SETTINGS,
    ) -> None:
        self._policy = policy
        self._settings = {**BED, **settings, 'policy': 'prose'}
        self._clock = FakeClock()
        self.world = World(causes, mix, self._clock)
        self._scene = Scene(self.world, mix)
        self.machine = build(self._scene, box)
        self._start = keys_of(self._scene, box)
        self.person = Person(self.world, box, mix)
        self.events: List[Any] = []  # of the latest trial: decisions alone
        self._open = contextlib.ExitStack()

    def __enter__(self) -> 'Bed':
        if self._policy is not None:
            self._open.enter_context(_time_of(self._clock))
            self._open.enter_context(_in_force(self._policy))
            OracleContainer.wrap(
                self.machine, name=TOP, settings=self._settings, expert=self.person
            )
            oracle = oracle_of(self.machine)
            oracle.describe_failure = lambda state: getattr(state, 'text', '')
            oracle.events.observers.append(self._observe)
        return self

    def __exit__(self, *error: object) -> None:
        self._open.close()

    def now_s(self) -> float:
        """Return the time of its world."""
        return self._clock.now()

    def _observe(self, event: Any) -> None:
        if event.kind is EventKind.DECISION:
            self.events.append(event)

    def trial(self, number: int) -> Trial:
        """Run the trial of that number, and judge it."""
        self._scene.begin(number)
        self.person.begin()
        self.events.clear()
        for key, value in self._start.items():
            self.machine.userdata[key] = list(value) if isinstance(value, list) else value
        try:
            outcome: Optional[str] = self.machine.execute()
        except smach.InvalidUserCodeError:
            outcome = None
        world = self.world
        return Trial(
            self._judge(outcome),
            world.failures,
            self.person.questions,
            sum(event.outcome not in (ASK, GIVE_UP) for event in self.events),
            (self._clock.now() - world.began_s) / 60.0,
            world.expert_s / 60.0,
            len(world.harmed),
            sum(map(_begins_streak, self.events)),
        )

    def _judge(self, outcome: Optional[str]) -> str:
        if self._scene.is_cut:
            self.machine.recall_preempt()
            return CUT_OFF
        if outcome != DONE:
            return FAILED
        return TRUE if self.world.is_goal_met() else FALSE


def _begins_streak(decision: Event) -> bool:
    """Whether a decision takes the first way of a streak."""
    data = decision.data or {}
    return bool(data.get('order')) and not data['streak']['tried']


@contextlib.contextmanager
def _time_of(clock: FakeClock) -> Iterator[None]:
    """Have the machines that are wrapped within go by a clock."""
    with mock.patch.object(tree, 'Clock', lambda: clock):
        yield


@contextlib.contextmanager
def _in_force(policy: Policy) -> Iterator[None]:
    """Have machines go by a policy that no setting names: in the place of `prose`."""
    with mock.patch.dict(POLICIES, {'prose': policy}):
        yield
