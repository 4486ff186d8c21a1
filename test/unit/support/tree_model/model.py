"""The model of a tree under an oracle: brute force, from the words of doc/, without SMACH."""
from typing import Any, Dict, List, Optional, Set, Tuple

from .answers import Options, draw_reply
from .ends import Goal, Reply
from .machine import MachinePart
from .parts import ConcurrencePart, Cut, IteratorPart, Jumping, LeafPart, Part, Raised, View
from .plan import CUT, KEYS, MOST_ENTRIES, TOP, Beside, Leaf, Machine, Repeated, TreePlan
from .scheduling import Scheduler
from .words import sounds_like_failure

PARTS = {Leaf: LeafPart, Machine: MachinePart, Beside: ConcurrencePart, Repeated: IteratorPart}


class Model:
    """A tree, executed by the model; what happens, by path of the container."""

    def __init__(self, plan: TreePlan, is_upstream: bool) -> None:
        """`is_upstream`: SMACH's own engine, which preempts Concurrences and Iterators otherwise.
        """
        self.plan = plan
        self.is_upstream = is_upstream
        self.course: List[Tuple[str, Tuple[Any, ...]]] = []
        self.budget = {'recoveries': 0, 'questions': 0}
        self._numbers: Dict[Tuple[str, ...], int] = {}
        self._machines: Dict[str, MachinePart] = {}
        self.top: MachinePart = self._make(plan.top, TOP, None)
        self.cross_jumps = 0

    def part_of(self, plan: Any, path: str, parent: Part) -> Part:
        """Make the part of a node; `path`: of its container."""
        return self._make(plan, path if isinstance(plan, Leaf) else '{}/{}'.format(
            path, plan.label), parent)

    def _make(self, plan: Any, path: str, parent: Any) -> Any:
        part = PARTS[type(plan)](self, plan, path, parent)
        if isinstance(part, MachinePart):
            self._machines[path] = part
        return part

    def execute(self) -> str:
        """One trial; returns the outcome, or '' where it raises."""
        for kind in self.budget:
            self.budget[kind] = 0
        for machine in self._machines.values():
            machine.memory.begin_trial()
        self._numbers = {key: number for key, number in self._numbers.items()
                         if key[0] != 'question'}
        self.entries = 0
        self._is_preempted = False
        scheduler = Scheduler(self.plan.seed)
        self.top.userdata.update({key: key + '0' for key in KEYS[:2]})
        try:
            return scheduler.run(self.top.execute(View({}, {})))
        except Raised:
            return ''
        except Cut:
            return CUT

    # -- what the parts need

    def takes_preempt(self) -> bool:
        """Whether the tree is preempted now: once in a trial."""
        takes, self._is_preempted = not self._is_preempted, True
        return takes

    def tell(self, path: str, event: Tuple[Any, ...]) -> None:
        """Note an event."""
        self.course.append((path, event))

    def enter(self, path: str, label: str, seen: Dict[str, Any]) -> None:
        """Note what a leaf sees when it is executed."""
        self.entries += 1
        if self.entries > MOST_ENTRIES:
            raise Cut()
        self.tell(path, ('ENTRY', label, tuple(sorted(seen.items()))))

    def number_of(self, *key: str) -> int:
        """How often this was asked for before."""
        number = self._numbers.get(key, 0)
        self._numbers[key] = number + 1
        return number

    def is_spent(self, kind: str) -> bool:
        """Whether the trial's budget of that kind is spent."""
        limit = self.plan.budget.get(kind)
        return limit is not None and self.budget[kind] >= limit

    def machine(self, path: str) -> MachinePart:
        """The machine of that path."""
        return self._machines[path]

    @staticmethod
    def is_machine(part: Any) -> bool:
        """Whether it is a wrapped container."""
        return isinstance(part, MachinePart)

    def place(self, name: str) -> Tuple[str, str]:
        """Path and label of PATH/LABEL below the top."""
        path, _, label = '{}/{}'.format(TOP, name).rpartition('/')
        return path, label

    def is_foreseen(self, inner: Part, outcome: str) -> bool:
        """Whether the author of a level above recovers from a container that ends so."""
        level = inner.parent
        if isinstance(level, IteratorPart):
            return outcome in level.plan.loop_outcomes and sounds_like_failure(outcome)
        if not isinstance(level, MachinePart):
            return False
        failed = level.failure_of(inner.label, outcome, False)
        if failed is None:
            return False
        if level.author_recovers(failed):
            return True
        way = failed.way
        return way is not None and bool(way.target) and not way.is_state and self.is_foreseen(
            level, way.target)

    def forget_begins(self, part: Part) -> None:
        """What was not entered in the middle is entered at its own start from now on."""
        for machine in self._machines.values():
            if part in _with_ancestors(machine):
                machine.begins_in = None

    def goal_of(self, origin: MachinePart, path: str, label: str) -> Goal:
        """Where to go from a container to a place."""
        target: Part = self._machines[path]
        place = label
        around = _with_ancestors(origin)
        begins = {}
        while target not in around or not isinstance(target, MachinePart):
            if isinstance(target, MachinePart):
                begins[target.path] = label
            label = target.label
            target = target.parent
        return Goal(target, label, begins, place=(path, place))

    def depart(self, origin: Part, goal: Goal) -> Jumping:
        """Have what runs beside the way to a goal preempted; of two jumps the first wins."""
        way, part = [], origin
        while part is not goal.machine:
            if isinstance(part.parent, ConcurrencePart):
                way.append((part.parent, part.label))
            part = part.parent
        goal = next((beside.goal for beside, _ in way if beside.goal is not None), goal)
        for beside, label in way:
            if beside.goal is None:
                beside.leave_for(goal, label)
        return Jumping(goal)

    def missing_at(self, goal: Goal, userdata: Dict[str, Any]) -> Tuple[str, ...]:
        """Input keys of a place that are not there, where a goal's machine has this userdata."""
        path, label = goal.place
        machine = self._machines[path]
        part = machine.child(label)
        remapping = machine.plan.remappings.get(label, {})
        return tuple(sorted(
            key for key in getattr(part.plan, 'reads', part.keys)
            if not self._will_have(machine, remapping.get(key, key), goal.machine, userdata)))

    def _will_have(self, part: Any, key: str, around: Any, userdata: Dict[str, Any]) -> bool:
        """Whether a container has a key once the machine has come down to it."""
        if part is around:
            return key in userdata
        if key in part.userdata:
            return True
        if key not in part.keys:
            return False
        remapping = getattr(part.parent.plan, 'remappings', {}).get(part.label, {})
        return self._will_have(part.parent, remapping.get(key, key), around, userdata)

    # -- questions

    def ask(self, machine: MachinePart, failed: Any, written: Set[str]) -> Optional[Reply]:
        """Put a question; the answer is drawn."""
        options = self.options(machine, failed.label, written)
        number = self.number_of('question', machine.path, failed.label)
        self.tell(machine.path, ('QUESTION', failed.label, failed.kind, options))
        return draw_reply(self.plan, machine.path, failed.label, number, options)

    def options(self, machine: MachinePart, label: str, written: Set[str]) -> Options:
        """What may be answered."""
        part = machine.child(label)
        places = [(each.path, name) for each in self._machines.values() for name in each.labels]
        levels = [each for each in _with_ancestors(machine) if isinstance(each, MachinePart)]
        missing = []
        for path, name in places:
            goal = self.goal_of(machine, path, name)
            missing.append((path, name, self.missing_at(goal, goal.machine.after_jump(
                goal.label, written if goal.machine is machine else set()))))
        return Options(
            tuple(sorted(places)), tuple(sorted(missing)),
            tuple(sorted((name, machine.way_of(label, name).target)
                         for name in part.plan.outcomes)),
            tuple(sorted((each.path, name) for each in levels for name in each.plan.outcomes)),
            tuple(sorted(getattr(part.plan, 'writes', part.keys))))


def _with_ancestors(part: Part) -> List[Part]:
    found = [part]
    while found[-1].parent is not None:
        found.append(found[-1].parent)
    return found
