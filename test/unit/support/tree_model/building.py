"""Trees of SMACH made from a plan."""

import threading
import time
from typing import Any, Callable, Dict, List, Optional

import smach

from .plan import MOST_ENTRIES, TOP, Beside, Leaf, Machine, Repeated, TreePlan
from .turns import Turns

LIMIT_S = 0.02  # of states that overrun
PREEMPT_S = 10.0  # a preempt that is on its way comes within


class World:
    """What the states of one tree share."""

    def __init__(self, plan: TreePlan) -> None:
        self.plan = plan
        self.course: List[Any] = []
        self.top: Any = None
        self.signal = threading.Event()  # set at the leafs' entry of that number
        self.signals_at = 0
        self.patience_s = PREEMPT_S
        self.at_entry: Callable[[], None] = lambda: None  # is called as a leaf begins
        self.begin_trial()

    def begin_trial(self) -> None:
        """Nothing has happened yet."""
        self.turns = Turns(self.plan.seed)
        self.is_cut = False
        self._is_preempted = False
        self._entries = 0
        self._lock = threading.Lock()

    def takes_preempt(self) -> bool:
        """Whether the tree is preempted now: once in a trial."""
        takes, self._is_preempted = not self._is_preempted, True
        return takes

    def tell(self, path: str, event: Any) -> None:
        """Note what happens, up to the cut."""
        if event[0] == 'DECISION' and event[-1] == 'held_back':
            self._count()  # an author may loop through such a state forever
        with self._lock:
            if not self.is_cut:
                self.course.append((path, event))

    def _count(self) -> None:
        self._entries += 1
        if self._entries > MOST_ENTRIES:
            self.is_cut = True
            self.turns.end()

    def enter(self, path: str, label: str, seen: Dict[str, Any]) -> None:
        """Note what a leaf sees when it is executed."""
        self._count()
        if self._entries == self.signals_at:
            self.signal.set()
        self.tell(path, ('ENTRY', label, tuple(sorted(seen.items()))))
        self.at_entry()


class Scripted(smach.State):
    """A leaf."""

    def __init__(self, world: World, plan: Leaf, path: str) -> None:
        super().__init__(
            outcomes=list(plan.outcomes), input_keys=list(plan.reads), output_keys=list(plan.writes)
        )
        self._world = world
        self._plan = plan
        self._path = path
        self.around: Any = None
        self.plan_label = plan.label
        # serves: it services a preempt, and goes on. leaves: it ends, and services none. ignores
        self.at_preempt = 'obeys'
        self._executions = 0
        self._asked = threading.Event()

    def request_preempt(self) -> None:
        """Note that it is to stop."""
        super().request_preempt()
        self._asked.set()

    def execute(self, ud: Any) -> Any:
        """Do what the script says."""
        self._asked.clear()
        plan, world = self._plan, self._world
        if plan.overruns:
            return self._overrun(ud)
        world.turns.wait('{}/{}'.format(self._path, plan.label))
        self._note_entry(ud)
        number = self._executions
        self._executions += 1
        for key in plan.writes:
            ud[key] = '{}/{}#{}'.format(self._path, plan.label, number)
        action = world.plan.action(self._path, plan, number)
        self._await_preempt()  # before its own, which would be taken for one that is on its way
        if action.kind == 'preempt' and world.takes_preempt():
            world.top.request_preempt()
            self._await_preempt()
        if self.preempt_requested() and self.at_preempt != 'ignores':
            if self.at_preempt != 'leaves':
                self.service_preempt()
            if self.at_preempt != 'serves':
                return action.outcome if action.kind == 'preempt' else 'preempted'
        if action.kind == 'raise':
            raise RuntimeError('as the script says')
        return action.outcome

    def _overrun(self, ud: Any) -> str:
        self._note_entry(ud)
        if not self.preempt_requested():
            self._asked.wait(self._world.patience_s)
        self.service_preempt()
        return 'preempted'

    def _note_entry(self, ud: Any) -> None:
        self._world.enter(
            self._path, self._plan.label, {key: ud[key] for key in self._plan.reads if key in ud}
        )

    def _await_preempt(self) -> None:
        """Where a Concurrence around passes a preempt on in a thread of its own, wait for it."""
        branches = owed_branches(self)
        if branches and not self.preempt_requested():
            self._asked.wait(self._world.patience_s)
        end = time.monotonic() + self._world.patience_s
        while not all(branch.preempt_requested() for branch in branches):
            if time.monotonic() > end:
                return
            time.sleep(0.001)  # upstream passes it on in a thread of its own


def owed_branches(state: Any) -> List[Any]:
    """The branches around, to which a preempt is on its way; it comes once to each that runs."""
    owed, is_cut_off = [], False
    while state is not None:
        around = getattr(state, 'around', None)
        if isinstance(around, Parallel):
            if state.plan_label in around.owed:
                around.owed.discard(state.plan_label)
                owed.append(state)
            else:
                is_cut_off = is_cut_off or not around.passes_on()
        state = around
    return [] if is_cut_off else owed


class _Impatient(threading.Condition):
    """Upstream's Concurrence looks every 0.1 s whether its threads have ended.

    It waits forever where a branch ends without an outcome, as at a shutdown: here, up to the cut.
    """

    def __init__(self, world: World) -> None:
        super().__init__()
        self._world = world
        self._notified = 0  # one that comes just at a timeout is not lost

    def notify_all(self) -> None:
        self._notified += 1
        super().notify_all()

    def wait(self, timeout: Optional[float] = None) -> bool:
        if timeout is not None:
            return super().wait(min(timeout, 0.002))
        before = self._notified
        while self._notified == before and not self._world.is_cut:
            super().wait(0.2)
        return True


class Parallel(smach.Concurrence):
    """A Concurrence whose branches are counted."""

    def prepare(self, world: World, labels: List[str], stops_at: Any) -> None:
        """Know what is needed for turns."""
        self._world = world
        self._labels = labels
        self._stops_at = set(stops_at)
        self._active = set()
        self.owed = set()
        self._has_preempted = False
        self._noting = threading.Lock()
        self.register_transition_cb(self._note_ends)
        if stops_at:
            self._child_termination_cb = self._stops
        if hasattr(self, '_done_cond'):
            self._done_cond = _Impatient(world)

    def execute(self, *args: Any, **kwargs: Any) -> Any:
        """Run all branches."""
        self._active = set(self._labels)
        self.owed = set()
        self._has_preempted = False
        self._world.turns.fork(len(self._labels))
        for label, state in self._states.items():
            if not isinstance(state, smach.Container):
                self._listen_to(label, state)
        return super().execute(*args, **kwargs)

    def _listen_to(self, label: str, branch: Any) -> None:
        """Note where a plain state raises, or what stands in for it now: its oracle gave up."""
        if 'execute' in vars(branch):
            return
        execute = branch.execute

        def listening(*args: Any) -> Any:
            try:
                return execute(*args)
            except Exception:
                self.branch_raised(label)
                raise

        branch.execute = listening

    def request_preempt(self) -> None:
        """Ask the branches to stop."""
        self._owe()
        super().request_preempt()

    def _owe(self) -> None:
        """The branches that run are preempted; upstream's engine does that once in an execution."""
        if self.passes_on():
            self.owed |= self._active
        self._has_preempted = True

    def passes_on(self) -> bool:
        """Whether a preempt would reach the branches that run."""
        return not (self._has_preempted and hasattr(self, '_done_cond'))

    def _stops(self, outcomes: Any) -> bool:
        return bool(self._stops_at & set(outcomes.values()))

    def _note_ends(self, *_: Any) -> None:
        """SMACH calls it as each branch begins and ends."""
        outcomes = dict(self._child_outcomes)
        with self._noting:
            ended = {label for label in self._active if outcomes.get(label) is not None}
            for label in ended:
                self._end(label, self._stops(outcomes))

    def branch_raised(self, label: str) -> None:
        """A branch has raised: the others are preempted."""
        self._end(label, True)

    def _end(self, label: str, stops: bool) -> None:
        self._active.discard(label)
        self.owed.discard(label)
        if stops:
            self._owe()
        self._world.turns.branch_ended(not self._active)


def _told(base: type) -> type:
    """The class of containers that tell a Concurrence around when they raise."""

    class Told(base):  # type: ignore
        around: Any = None
        plan_label = ''

        def execute(self, *args: Any, **kwargs: Any) -> Any:
            try:
                return super().execute(*args, **kwargs)
            except Exception:
                if isinstance(self.around, Parallel):
                    self.around.branch_raised(self.plan_label)
                raise

    Told.__name__ = Told.__qualname__ = base.__name__
    return Told


ToldMachine = _told(smach.StateMachine)
ToldSequence = _told(smach.Sequence)
ToldIterator = _told(smach.Iterator)
ToldConcurrence = _told(Parallel)


def build(world: World) -> Any:
    """The tree of the world's plan, not wrapped yet."""
    world.top = _machine(world, world.plan.top, TOP)
    return world.top


def _node(world: World, plan: Any, path: str, around: Any) -> Any:
    if isinstance(plan, Leaf):
        made = Scripted(world, plan, path)
    else:
        made = _BUILDERS[type(plan)](world, plan, '{}/{}'.format(path, plan.label))
    made.around = around
    made.plan_label = plan.label
    return made


def _machine(world: World, plan: Machine, path: str) -> Any:
    keys = {'input_keys': list(plan.keys), 'output_keys': list(plan.keys)}
    if plan.is_sequence:
        machine = ToldSequence(list(plan.outcomes), 'ok', **keys)
    else:
        machine = ToldMachine(list(plan.outcomes), **keys)
    with machine:
        for child in plan.children:
            machine.add(
                child.label,
                _node(world, child, path, machine),
                dict(plan.transitions[child.label]),
                dict(plan.remappings[child.label]),
            )
    return machine


def _beside(world: World, plan: Beside, path: str) -> Any:
    made = ToldConcurrence(
        list(plan.outcomes),
        plan.default,
        input_keys=list(plan.keys),
        output_keys=list(plan.keys),
        outcome_map=plan.outcome_map,
    )
    made.prepare(world, [child.label for child in plan.children], plan.stops_at)
    with made:
        for child in plan.children:
            smach.Concurrence.add(child.label, _node(world, child, path, made))
    return made


def _repeated(world: World, plan: Repeated, path: str) -> Any:
    made = ToldIterator(
        list(plan.outcomes),
        list(plan.keys),
        list(plan.keys),
        it=list(range(plan.items)),
        it_label='item',
        exhausted_outcome='ok',
    )
    with made:
        smach.Iterator.set_contained_state(
            plan.child.label,
            _node(world, plan.child, path, made),
            loop_outcomes=list(plan.loop_outcomes),
            final_outcome_map=dict(plan.final_map),
        )
    return made


_BUILDERS: Dict[type, Callable[..., Any]] = {
    Machine: _machine,
    Beside: _beside,
    Repeated: _repeated,
}
