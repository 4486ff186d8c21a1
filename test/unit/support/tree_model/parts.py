"""The model's leafs, Iterators and Concurrences, as the contract of SMACH says."""
from typing import Any, Dict, List, Optional, Tuple

from .plan import Beside, Leaf, Repeated
from .scheduling import Course, Fork, Turn

OVERRUN = object()
UNSAID = '(as SMACH preempts)'  # the outcome of an Iterator or a Concurrence that is left


class View:
    """What a child sees of the userdata of its container."""

    def __init__(self, store: Dict[str, Any], remapping: Dict[str, str]) -> None:
        self._store = store
        self._remapping = remapping

    def copy_to(self, keys: Tuple[str, ...], inner: Dict[str, Any]) -> None:
        """Copy input keys where they are present."""
        for key in keys:
            if self._remapping.get(key, key) in self._store:
                inner[key] = self._store[self._remapping.get(key, key)]

    def copy_from(self, keys: Tuple[str, ...], inner: Dict[str, Any]) -> None:
        """Copy output keys where they are present."""
        for key in keys:
            if key in inner:
                self._store[self._remapping.get(key, key)] = inner[key]


class Raised(Exception):
    """A state or a container raises."""


class Cut(BaseException):
    """The course is long enough."""


class Jumping(Exception):
    """The machine goes elsewhere; containers on the way are left."""

    def __init__(self, goal: Any) -> None:
        super().__init__()
        self.goal = goal


class Part:
    """A node of the model."""

    def __init__(self, run: Any, plan: Any, path: str, parent: Any) -> None:
        self.run = run
        self.plan = plan
        self.path = path  # of a leaf: that of its container
        self.label = plan.label
        self.parent = parent
        self.flag = False  # a preempt is requested
        self.settled = False  # its failure
        self.left_with = ''  # where a jump leaves it
        self.keys: Tuple[str, ...] = getattr(plan, 'keys', ())

    def request_preempt(self) -> None:
        """Ask it to stop."""
        self.flag = True

    def children(self) -> List['Part']:
        """The parts below."""
        return []

    def child(self, label: str) -> 'Part':
        """The part of that label."""
        return next(part for part in self.children() if part.label == label)


class LeafPart(Part):
    """A state."""

    plan: Leaf

    def __init__(self, run: Any, plan: Leaf, path: str, parent: Any) -> None:
        super().__init__(run, plan, path, parent)
        self._executions = 0

    def execute(self, view: View) -> Course:
        """Do what the script says; returns the outcome."""
        plan = self.plan
        if plan.overruns:
            self.run.enter(self.path, self.label, self._seen(view))
            return OVERRUN
        yield Turn('{}/{}'.format(self.path, self.label))
        self.run.enter(self.path, self.label, self._seen(view))
        number = self._executions
        self._executions += 1
        value = '{}/{}#{}'.format(self.path, self.label, number)
        view.copy_from(plan.writes, {key: value for key in plan.writes})
        action = self.run.plan.action(self.path, plan, number)
        if action.kind == 'preempt' and self.run.takes_preempt():
            self.run.top.request_preempt()
        if self.flag:
            self.flag = False
            return action.outcome if action.kind == 'preempt' else 'preempted'
        if action.kind == 'raise':
            raise Raised()
        return action.outcome

    def _seen(self, view: View) -> Dict[str, Any]:
        seen: Dict[str, Any] = {}
        view.copy_to(self.plan.reads, seen)
        return seen


class IteratorPart(Part):
    """An Iterator."""

    plan: Repeated

    def __init__(self, run: Any, plan: Repeated, path: str, parent: Any) -> None:
        super().__init__(run, plan, path, parent)
        self.left_with = UNSAID
        self._child = run.part_of(plan.child, path, self)
        self.userdata: Dict[str, Any] = {}
        self._runs = False

    def children(self) -> List[Part]:
        return [self._child]

    def request_preempt(self) -> None:
        self.flag = True
        if self._runs:
            self._child.request_preempt()

    def execute(self, view: View) -> Course:
        """Go through the items; returns the outcome."""
        view.copy_to(self.keys, self.userdata)
        self._runs = True
        self.settled = False
        try:
            outcome = yield from self._iterate()
        except Raised:
            self.settled = self._child.settled
            raise
        except Jumping:
            self.flag = False
            view.copy_from(self.keys, self.userdata)
            raise
        finally:
            self._runs = False
        self.flag = False
        view.copy_from(self.keys, self.userdata)
        return self.plan.final_map.get(outcome, outcome)

    def _iterate(self) -> Course:
        child = self._child
        for _ in range(self.plan.items):
            if self.flag and not self.run.is_upstream:
                child.request_preempt()
            outcome = yield from child.execute(View(self.userdata, {}))
            self.settled = child.settled
            if self.flag or outcome not in self.plan.loop_outcomes:
                return outcome
        self.settled = False
        return 'ok'


class ConcurrencePart(Part):
    """A Concurrence."""

    plan: Beside

    def __init__(self, run: Any, plan: Beside, path: str, parent: Any) -> None:
        super().__init__(run, plan, path, parent)
        self.left_with = UNSAID
        self._children = [run.part_of(child, path, self) for child in plan.children]
        self.userdata: Dict[str, Any] = {}
        self._active: List[str] = []
        self._outcomes: Dict[str, str] = {}
        self._error: Optional[Exception] = None
        self._is_reached = False  # by a preempt while branches run
        self.goal: Any = None  # of the jump that leaves it

    def children(self) -> List[Part]:
        return self._children

    def execute(self, view: View) -> Course:
        """Run all branches; returns the outcome."""
        view.copy_to(self.keys, self.userdata)
        self._active = [child.label for child in self._children]
        self._outcomes = {}
        self._error = None
        self._is_reached = False
        self.goal = None
        self.settled = False
        if self.flag and not self.run.is_upstream:
            self._preempt_active()
        yield Fork(self, [(child.label, self._branch(child)) for child in self._children])
        is_deaf = any(child.flag for child in self._children)
        for child in self._children:
            child.flag = False
        self.settled = any(child.settled for child in self._children)
        if self.goal is not None:
            self.flag = False
            view.copy_from(self.keys, self.userdata)
            raise Jumping(self.goal)
        if self._error is not None:
            self.flag = False
            raise self._error
        serviced = self._settle_preempt(is_deaf)
        outcome = self._outcome(serviced)
        view.copy_from(self.keys, self.userdata)
        return outcome

    def _branch(self, child: Part) -> Course:
        child.settled = False
        return child.execute(View(self.userdata, {}))

    def _settle_preempt(self, is_deaf: bool) -> bool:
        if not self.flag or is_deaf or not (self._is_reached or self.run.is_upstream):
            return False
        self.flag = False
        return True

    def _outcome(self, serviced: bool) -> str:
        if serviced and self.run.is_upstream:
            return 'preempted'
        for outcome, wanted in self.plan.outcome_map.items():
            if all(self._outcomes[label] == each for label, each in wanted.items()):
                return outcome
        return 'preempted' if serviced else self.plan.default

    def child_ended(self, label: str, outcome: Any, error: Optional[Exception]) -> None:
        """A branch has ended."""
        self._active.remove(label)
        if isinstance(error, Jumping):
            return
        if error is not None:
            self._error = error
            self._preempt_active()
            return
        self._outcomes[label] = outcome
        if set(self._outcomes.values()) & set(self.plan.stops_at):
            self._preempt_active()

    def request_preempt(self) -> None:
        self.flag = True
        self._preempt_active()

    def leave_for(self, goal: Any, label: str) -> None:
        """A branch goes elsewhere: the others are preempted."""
        self.goal = goal
        self.flag = True
        self._preempt_active(but=label)

    def _preempt_active(self, but: str = '') -> None:
        """Preempt the branches that run; upstream's engine does that once in an execution."""
        if self._is_reached and self.run.is_upstream:
            return
        self._is_reached = self._is_reached or bool(self._active)
        for label in self._active:
            if label != but:
                self.child(label).request_preempt()
