"""The model's leafs and Concurrences, as the contract of SMACH says."""

from typing import Any, Dict, List, Optional, Tuple

from .plan import Beside, Leaf
from .scheduling import Course, Fork, Turn

OVERRUN = object()


class Unsaid(str):
    """An outcome that may be another: upstream's engine may preempt a branch that has ended."""

    also = ''  # the other one

    @classmethod
    def of(cls, outcome: str, also: str) -> 'Unsaid':
        """One or the other."""
        unsaid = cls(outcome)
        unsaid.also = also
        return unsaid

    def mapped(self, outcomes: Dict[str, str]) -> 'Unsaid':
        """What a map makes of it."""
        return self.of(outcomes.get(self, self), outcomes.get(self.also, self.also))


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
        self.ended_as_meant = False  # by a state whose author means it so
        self.left_with = ''  # where a jump leaves it
        self.keys: Tuple[str, ...] = getattr(plan, 'keys', ())

    def request_preempt(self) -> None:
        """Ask it to stop."""
        self.flag = True

    def recall_preempts(self) -> None:
        """Take requests back from it and from all below: what they were for is over."""
        self.flag = False
        for part in self.children():
            part.recall_preempts()

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
            was_asked, self.flag = self.flag, False
            return 'preempted' if was_asked else OVERRUN
        yield Turn('{}/{}'.format(self.path, self.label))
        self.run.enter(self.path, self.label, self._seen(view))
        number = self._executions
        self._executions += 1
        value = '{}/{}#{}'.format(self.path, self.label, number)
        view.copy_from(plan.writes, dict.fromkeys(plan.writes, value))
        action = self.run.plan.action(self.path, plan, number)
        if action.kind == 'preempt' and self.run.takes_preempt():
            self.run.top.request_preempt()
        if self.flag:
            self.flag = False
            return action.outcome if action.kind == 'preempt' else 'preempted'
        if action.kind == 'raise':
            raise Raised
        return action.outcome

    def _seen(self, view: View) -> Dict[str, Any]:
        seen: Dict[str, Any] = {}
        view.copy_to(self.plan.reads, seen)
        return seen


class ConcurrencePart(Part):
    """A Concurrence."""

    plan: Beside

    def __init__(self, run: Any, plan: Beside, path: str, parent: Any) -> None:
        super().__init__(run, plan, path, parent)
        self.userdata: Dict[str, Any] = {}
        self._children = [run.branch_of(child, path, self) for child in plan.children]
        self._branches = [child.label for child in plan.children if isinstance(child, Leaf)]
        self._active: List[str] = []
        self._outcomes: Dict[str, str] = {}
        self._error: Optional[Exception] = None
        self._is_reached = False  # by a preempt while branches run
        self.goal: Any = None  # of the jump that leaves it

    def children(self) -> List[Part]:
        return self._children

    def execute(self, view: View) -> Course:
        """Run all branches; returns the outcome."""
        return self.run.between_ends(self, self._branches, self._execute(view))

    def _execute(self, view: View) -> Course:
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
        if self._error is None or not self.run.is_upstream:
            for child in self._children:
                child.flag = False
        self.settled = any(child.settled for child in self._children)
        self.ended_as_meant = any(child.ended_as_meant for child in self._children)
        goal = self.goal
        if self._error is not None:
            self.flag = self.flag and self.run.is_upstream  # whose requests outlive an error
            if goal is None or goal.machine.flag:
                raise self._error
            self.left_with = ''
            raise Jumping(goal)
        serviced = self._settle_preempt(is_deaf)
        outcome = self._outcome(serviced)
        view.copy_from(self.keys, self.userdata)
        if goal is not None:
            self.flag = False
            self.left_with = outcome
            if self.run.is_upstream:
                self.left_with = Unsaid.of(outcome, self._outcome(not serviced))
            raise Jumping(goal)
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
            outcome = self.child(label).left_with
        elif error is not None:
            self._error = error
            if self.run.is_upstream and not self._is_reached:
                self.child(label).request_preempt()  # there it has not ended
            self._preempt_active()
            return
        self._outcomes[label] = outcome
        if set(self._outcomes.values()) & set(self.plan.stops_at):
            self._preempt_active()

    def would_stop(self, label: str, outcome: Any) -> bool:
        """Whether others that run would stop if a branch ended so; None: by an error."""
        stops_at = set(self.plan.stops_at)
        others_run = any(each != label for each in self._active)
        stops = outcome is None or stops_at & {outcome, *self._outcomes.values()}
        return bool(stops_at and others_run and stops)

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
