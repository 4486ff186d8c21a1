"""Trees of SMACH executed under an oracle; what happens is noted as the model notes it."""

import threading
import time
from typing import Any, Dict, List, Optional, Tuple

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.asking.question import Answer, AnswerKind, Expert
from smach_oracle.oracle.execution.wrapping import sync_oracle
from smach_oracle.oracle.machine.nesting import nodes_of
from smach_oracle.oracle.records.events import EventKind, FailureKind
from smach_oracle.oracle.recovery.phases import OracleState

from .answers import Options, draw_reply
from .building import LIMIT_S, World, build, owed_branches
from .ends import Reply
from .plan import CUT, KEYS, TOP, TreePlan

NOTED = {
    EventKind.CONTAINER_START,
    EventKind.CONTAINER_END,
    EventKind.STATE_START,
    EventKind.TRANSITION,
    EventKind.FAILURE,
    EventKind.PRECONDITION_START,
    EventKind.PRECONDITION_END,
    EventKind.DECISION,
    EventKind.JUMP,
    EventKind.QUERY_OPENED,
    EventKind.QUERY_ANSWERED,
    EventKind.QUERY_EXPIRED,
    EventKind.SUPERSEDE,
    EventKind.GIVE_UP,
}
CLASSES = ('', 'LOW', 'MODERATE', 'HIGH')


class Executed:
    """A tree under an oracle; what happens, by path of the container."""

    def __init__(self, plan: TreePlan) -> None:
        self.plan = plan
        self.world = World(plan)
        self.machine = build(self.world)
        OracleContainer.wrap(
            self.machine,
            name=TOP,
            settings=self.settings(),
            preconditions=self._checks(),
            expert=self.expert(),
        )
        for node in nodes_of(self.machine):
            _InTurn.take_over(self.world, node)
        self.machine.events.observers.append(self._observe)

    def settings(self) -> Dict[str, Any]:
        """As `wrap` takes them."""
        return settings_of(self.plan)

    def expert(self) -> Optional[Expert]:
        """Who is asked."""
        return DrawnExpert(self.world) if self.plan.has_expert else None

    def execute(self) -> str:
        """One trial; returns the outcome, or '' where it raises."""
        world = self.world
        world.begin_trial()
        smach.set_shutdown_check(lambda: world.is_cut)
        self.machine.userdata.update(_userdata())
        try:
            outcome = self.machine.execute()
        except (smach.InvalidUserCodeError, smach.InvalidTransitionError, smach.InvalidStateError):
            outcome = ''
        finally:
            world.turns.end()
            smach.set_shutdown_check(lambda: False)
        return CUT if world.is_cut else outcome

    @property
    def course(self) -> List[Tuple[str, Any]]:
        """What happened."""
        return self.world.course

    def _observe(self, event: Any) -> None:
        if event.kind not in NOTED:
            return
        noted: Tuple[Any, ...] = (event.kind.name, event.state, event.outcome, event.target)
        if event.kind is EventKind.FAILURE:
            noted += (
                FailureKind(event.failure_kind).name,
                CLASSES[event.failure_class],
                event.rate,
                event.continuous,
            )
        elif event.kind is EventKind.DECISION:
            noted += ((event.data or {}).get('decided_by'),)
        elif event.kind is EventKind.JUMP:
            noted += (tuple(sorted(event.data['missing_keys'])), event.data['userdata'])
        self.world.tell(event.path, noted)

    def _checks(self) -> Dict[str, List[Any]]:
        return {
            _relative(path, label): [
                check.name if check.is_label else _Check(self.plan, path, label, check)
                for check in own.preconditions
            ]
            for (path, label), own in self.plan.states.items()
            if own.preconditions
        }


class _InTurn(OracleState):
    """Takes a turn before it decides about a state that was held back, and that took none."""

    def __init__(self, world: World, node: Any) -> None:
        super().__init__()
        self._world = world
        self._node = node

    @classmethod
    def take_over(cls, world: World, node: Any) -> None:
        """Be the meta state of a container, or of a branch."""
        machine, label = node.machine, node.settings.oracle_label
        machine._states[label] = cls(world, node)
        machine._remappings[label] = {}
        machine._transitions.pop(label, None)
        sync_oracle(node)

    def execute(self, ud: Any) -> str:
        """Recover, as its class does."""
        recovery: Any = self._recovery
        if recovery.failure.is_held_back:
            self._world.turns.wait('{}/{}'.format(self._node.path, recovery.failure.state))
            self._await_preempt(recovery)
        return super().execute(ud)

    def _await_preempt(self, recovery: Any) -> None:
        """Where Concurrences around are about to stop their branches, wait for all of them.

        Whoever takes a turn later does not wait for those again.
        """
        own = self._node.machine._states[recovery.failure.state]  # its oracle is asked in its place
        branches = owed_branches(own)
        end = time.monotonic() + self._world.patience_s
        while branches and time.monotonic() < end:
            if recovery.stopped() and all(
                each is own or each.preempt_requested() for each in branches
            ):
                return
            time.sleep(0.001)  # it comes in the thread of a branch beside


def _userdata() -> smach.UserData:
    userdata = smach.UserData()
    for key in KEYS[:2]:
        userdata[key] = key + '0'
    return userdata


def _relative(path: str, label: str) -> str:
    return '{}/{}'.format(path, label)[len(TOP) + 1 :]


class _Check:
    """A precondition that says what is drawn."""

    def __init__(self, plan: TreePlan, path: str, label: str, check: Any) -> None:
        self.__name__ = check.name
        self._drawn = (plan, path, label, check)
        self._calls = 0

    def __call__(self, ud: Any) -> bool:
        plan, path, label, check = self._drawn
        number = self._calls
        self._calls += 1
        if check.writes:
            ud[check.writes] = '{}/{} {}#{}'.format(path, label, check.name, number)
        return plan.holds(path, label, check, number)


def settings_of(plan: TreePlan) -> Dict[str, Any]:
    """The settings of a plan as `wrap` takes them."""
    kind, name = plan.on_no_answer
    settings: Dict[str, Any] = {
        'policy': plan.policy,
        'estimator': plan.estimator,
        'memory': plan.memory,
        'prior': plan.prior,
        'max_recoveries': plan.max_recoveries,
        'budget': dict(plan.budget),
        'author_recoveries': plan.author_recoveries,
        'userdata': plan.userdata,
        'escalate': plan.escalate,
        'on_no_answer': kind if kind == 'stop' else {kind: name},
        'states': {},
    }
    for (path, label), own in plan.states.items():
        said = {
            key: list(value) if isinstance(value, tuple) else value
            for key, value in own._asdict().items()
            if key != 'preconditions' and value not in (None, (), 'allow')
        }
        if said:
            settings['states'][_relative(path, label)] = said
    for path, leaf in _overrunning(TOP, plan.top):
        settings['states'].setdefault(_relative(path, leaf.label), {}).update(
            time_limit_s=LIMIT_S, grace_period_s=5
        )
    return settings


def _overrunning(path: str, node: Any) -> List[Tuple[str, Any]]:
    found = []
    for child in getattr(node, 'children', None) or [node.child]:
        if not hasattr(child, 'overruns'):
            found.extend(_overrunning('{}/{}'.format(path, child.label), child))
        elif child.overruns:
            found.append((path, child))
    return found


class DrawnExpert(Expert):
    """Answers what is drawn."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._numbers: Dict[Tuple[str, ...], int] = {}

    def ask(self, question: Any, cancelled: threading.Event, progress: Any) -> Optional[Answer]:
        """Return the answer that the model gets, too."""
        path, label = question.container_path, question.failed_state
        options = options_of(question)
        key = (question.trial_id, path, label)
        number = self._numbers.get(key, 0)
        self._numbers[key] = number + 1
        self._world.tell(path, ('QUESTION', label, question.failure_kind.name, options))
        reply = draw_reply(self._world.plan, path, label, number, options)
        return reply and answer_of(reply)


def options_of(question: Any) -> Options:
    """What a question offers."""
    path = question.container_path
    open_now = [choice for choice in question.choices if not choice.blocked]
    return Options(
        tuple(sorted((choice.container or path, choice.state) for choice in open_now)),
        tuple(
            sorted(
                (choice.container or path, choice.state, tuple(sorted(choice.missing_keys)))
                for choice in open_now
            )
        ),
        tuple(
            sorted(
                (choice.container or path, choice.state, tuple(sorted(choice.repeats)))
                for choice in open_now
                if choice.repeats
            )
        ),
        tuple(sorted((choice.outcome, choice.target) for choice in question.supersede_outcomes)),
        tuple(
            sorted(
                [(path, outcome) for outcome in question.give_up_outcomes]
                + [(each.container, each.outcome) for each in question.give_up_above]
            )
        ),
        tuple(sorted(question.output_keys)),
    )


def answer_of(reply: Reply) -> Answer:
    """The executive's form of a drawn answer."""
    if reply.kind == 'goto':
        return Answer(AnswerKind.GOTO, state=reply.name, container=reply.path)
    if reply.kind == 'supersede':
        return Answer(AnswerKind.SUPERSEDE, outcome=reply.name, outputs=dict(reply.outputs))
    return Answer(AnswerKind.GIVE_UP, outcome=reply.name, container=reply.path)
