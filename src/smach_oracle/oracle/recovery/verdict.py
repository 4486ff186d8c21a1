"""The verdict on one failure: where the machine goes from the meta state (paper, section IV-A).

There are four kinds, and no other way out. `execution.applying` carries them out. An ending is the
way a container ends, or goes on, where no oracle leads it elsewhere.
"""

from typing import FrozenSet, NamedTuple, Optional, Sequence, Union

import smach

from ..decision.ways import WayResult
from ..machine.places import JumpPath, repeated_on, why_closed_on
from ..machine.site import Route, route_of
from ..machine.state_record import StateRecord
from ..machine.tree_node import TreeNode
from ..records.events import in_event
from ..records.streaks import OpenStreak
from ..scope.scope import Reason
from ..settings.failing_outcomes import PREEMPTED, is_preempted
from ..smach_private import states_of
from .failure import Failure


class ContainerEnding(NamedTuple):
    """The way a container would end, or go on, without an oracle: exactly one is set."""

    state: Optional[str] = None
    outcome: Optional[str] = None
    error: Optional[Exception] = None
    obeys: bool = False  # `state` is what the author drew after `preempted`: a preempt ends there


class Foreseen(NamedTuple):
    """The reason why the end of a container is left to the one above it."""

    text: str
    item_outcome: str = ''  # the outcome with which an item of an Iterator is passed over


class ChosenWay(NamedTuple):
    """A way of the menu that a policy has chosen. `gone`: it, without a result yet.

    `since_s`: when it was chosen, on the trial's clock of work.
    """

    node: TreeNode
    record: StateRecord
    gone: WayResult
    since_s: float

    def note(self) -> None:
        """Note that it is gone now, also in the streaks of the states around."""
        self.go()
        streak = streak_of(self.node, self.record)
        if streak is not None:
            streak.note(self.gone.way, self.gone.hoped is not None)
            streak.leaves = False
        for below, above in zip((self.node, *self.node.around()), self.node.around()):
            around = streak_of(above, above.record(below.labels_from_parent[0]))
            if around is not None:
                around.attempts += 1

    def go(self) -> None:
        """Note that it is gone now, outside every streak."""
        self.record.go_way(self.gone, self._minutes)

    def _minutes(self) -> float:
        return (self.node.tree.budget.work_time.now() - self.since_s) / 60.0


def streak_of(node: TreeNode, record: StateRecord) -> Optional[OpenStreak]:
    """Return the streak of a state, None where none goes on."""
    return node.records.streaks.of(record.label, record.totals[0])


class JumpTo(NamedTuple):
    """Go to a state, its userdata as the settings say."""

    jump_path: JumpPath
    by: str = ''  # the expert's name
    text: str = ''
    # userdata keys of the container where the ways meet that survive a restore
    written: FrozenSet[str] = frozenset()
    decided_by: Optional[TreeNode] = None  # the level above, as if its own state had failed
    restarts: bool = False  # with the userdata of the start, in all containers
    wait_s: float = 0.0  # before
    chosen: Optional[ChosenWay] = None  # of the streak that it belongs to
    asked: Optional[ChosenWay] = None  # the choice of a person, of no streak


class Supersede(NamedTuple):
    """Go on as if the failed state had ended with `outcome`."""

    outcome: str
    by: str = ''
    text: str = ''


class GiveUp(NamedTuple):
    """End, or go on, as `ending` says."""

    ending: ContainerEnding
    by: str = ''
    text: str = ''
    level: Optional[TreeNode] = None  # the container that ends. None: that of the failure


class Preempted(NamedTuple):
    """End, or go on, as `ending` says: a preempt or a shutdown has ended the recovery.

    `ending` is empty where the trial ends early, and the container has no outcome.
    """

    ending: ContainerEnding = ContainerEnding()


Verdict = Union[JumpTo, Supersede, GiveUp, Preempted]


def arrives_at(verdict: Verdict) -> Optional[TreeNode]:
    """Return the level above that goes on, once the containers below it are left.

    None means no other.
    """
    if isinstance(verdict, JumpTo):
        return verdict.jump_path.meeting_node if verdict.jump_path.left_containers else None
    return verdict.level if isinstance(verdict, GiveUp) else None


class Departure:
    """A verdict on its way from the container of a failure to the level that follows it."""

    def __init__(self, verdict: Verdict, arrives_at: TreeNode, failed_path: str) -> None:
        """`failed_path`: that of the failed state."""
        self.verdict = verdict
        self.arrives_at = arrives_at
        self.failed_path = failed_path
        self.is_decided_again = isinstance(verdict, JumpTo) and verdict.chosen is not None
        self._repeated = (
            set(repeated_on(verdict.jump_path)) if isinstance(verdict, JumpTo) else set()
        )

    def why_not(self) -> str:
        """Say what prevents it at its arrival that did not when it was decided, or '' if nothing.

        What was preempted may have gone on for a while.
        """
        if not isinstance(self.verdict, JumpTo):
            return ''
        way = self.verdict.jump_path
        closed = why_closed_on(way)
        repeated = sorted(set(repeated_on(way)).difference(self._repeated))
        if not (closed or repeated):
            return ''
        place = way.place.path
        return 'cannot go to {}: {}'.format(
            place,
            closed or '{} was done while the way there was made free'.format(', '.join(repeated)),
        )

    def is_own(self, node: TreeNode) -> bool:
        """Whether a container's own oracle has decided, as if its state had failed."""
        return isinstance(self.verdict, JumpTo) and self.verdict.decided_by is node


def leads_to(verdict: Verdict) -> str:
    """Return the state or outcome that the meta state leads to.

    It is '' where it raises, and where a level above goes on.
    """
    if arrives_at(verdict) is not None:
        return ''
    if isinstance(verdict, JumpTo):
        return verdict.jump_path.first_label
    if isinstance(verdict, Supersede):
        return verdict.outcome
    ending = verdict.ending
    return ending.state or in_event(ending.outcome)


# -- endings


def _ending_by(route: Route, obeys: bool = False) -> ContainerEnding:
    if route.is_state:
        return ContainerEnding(route.target, obeys=obeys)
    return ContainerEnding(outcome=route.target)


def natural_ending(node: TreeNode, failure: Failure) -> ContainerEnding:
    """Return how the failure would have ended the container without an oracle.

    Where it raises, and an earlier failure would have ended the container, that ending counts. An
    overrun has no such ending, since the state would still run: the container's own failing
    outcome, else an error.
    """
    if failure.route is not None and failure.route.leads_on:
        return _ending_by(failure.route)
    if failure.earlier_route is not None:
        return _ending_by(failure.earlier_route)
    if failure.error is not None:
        return ContainerEnding(error=failure.error())
    outcome = failing_outcome(node, node.in_force.failing.first)
    if outcome is not None:
        return ContainerEnding(outcome=outcome)
    return ContainerEnding(
        error=smach.InvalidUserCodeError('State {!r} {}'.format(failure.state, failure.text))
    )


def route_at_preempt(machine: smach.StateMachine, label: str) -> Route:
    """Follow the outcome `preempted` of a state that a preempt ends before it has done anything.

    It leads nowhere where the state has no such outcome, or where it leads to the state itself.
    """
    registered = states_of(machine)[label].get_registered_outcomes()
    outcome = next((each for each in registered if is_preempted(each)), None)
    route = Route('', False) if outcome is None else route_of(machine, label, outcome)
    return Route('', False) if route.target == label else route


def preempted_ending(node: TreeNode, failure: Failure) -> ContainerEnding:
    """Return how a container ends, or goes on, where a preempt or a shutdown ends a recovery.

    At a preempt it goes by the outcome `preempted` of the failed state, as its author drew it,
    unless the state still runs. Else, and once a preempt was obeyed, its own outcome `preempted`
    ends it.
    """
    machine = node.machine
    is_preempt_alone = node.execution.scope.reasons == {Reason.PREEMPTED}
    if is_preempt_alone and not node.tree.workers.blocked(states_of(machine)[failure.state]):
        route = route_at_preempt(machine, failure.state)
        if route.leads_on:
            return _ending_by(route, obeys=True)
    if PREEMPTED in machine.get_registered_outcomes():
        return ContainerEnding(outcome=PREEMPTED)
    return natural_ending(node, failure)


def failing_outcome(node: TreeNode, first: Sequence[Optional[str]]) -> Optional[str]:
    """Return the failing outcome with which a container ends that nobody leads elsewhere.

    None means it has none. `first`: names that come before the order of the alphabet.
    """
    outcomes = sorted(node.machine.get_registered_outcomes(), key=str)
    found = [each for each in first if each in outcomes]
    found += (each for each in outcomes if each in node.in_force.failing)
    return found[0] if found else None


def leaving_outcome(node: TreeNode, failure: Optional[Failure] = None) -> str:
    """Return an outcome with which a container ends that is left: nobody goes by it.

    :param failure: what would have ended it.
    """
    wanted = natural_ending(node, failure).outcome if failure is not None else None
    found = failing_outcome(node, (PREEMPTED, wanted))
    return found or min(node.machine.get_registered_outcomes(), key=str)


def outcome_of_early_end(node: TreeNode) -> Optional[str]:
    """Return an outcome for a Concurrence or an Iterator where its trial has ended early.

    It wants one, and nobody goes by it.
    """
    is_wanted = node.tree.early_end.why is not None and node.runs_in_branch
    return leaving_outcome(node) if is_wanted else None
