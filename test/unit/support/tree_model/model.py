"""The model of a tree under an oracle: brute force, from the words of doc/, without SMACH."""

from typing import Any, Dict, List, Optional, Set, Tuple

from .answers import Options, draw_reply
from .branch import BranchPart
from .ends import Goal, Reply
from .iterating import IteratorPart
from .machine import MachinePart
from .parts import ConcurrencePart, Cut, Jumping, LeafPart, Part, Raised, View
from .plan import CUT, KEYS, MOST_ENTRIES, TOP, Beside, Leaf, Machine, Repeated, TreePlan
from .repeats import Repeats
from .scheduling import Course, Scheduler
from .words import sounds_like_failure

PARTS = {Leaf: LeafPart, Machine: MachinePart, Beside: ConcurrencePart, Repeated: IteratorPart}


class Model:
    """A tree, executed by the model; what happens, by path of the container."""

    def __init__(self, plan: TreePlan, is_upstream: bool) -> None:
        """`is_upstream`: SMACH's own engine, which preempts Concurrences and Iterators
        otherwise.
        """
        self.plan = plan
        self.is_upstream = is_upstream
        self.course: List[Tuple[str, Tuple[Any, ...]]] = []
        self.repeats = Repeats(plan)
        self.budget = {'recoveries': 0, 'questions': 0}
        self._numbers: Dict[Tuple[str, ...], int] = {}
        self._machines: Dict[str, MachinePart] = {}
        self._branches: List[BranchPart] = []
        self._iterators: List[IteratorPart] = []
        self.top: MachinePart = self._make(plan.top, TOP, None)
        self.cross_jumps = 0

    def part_of(self, plan: Any, path: str, parent: Part) -> Part:
        """Make the part of a node; `path`: of its container."""
        return self._make(
            plan, path if isinstance(plan, Leaf) else '{}/{}'.format(path, plan.label), parent
        )

    def _make(self, plan: Any, path: str, parent: Any) -> Any:
        part = PARTS[type(plan)](self, plan, path, parent)
        if isinstance(part, MachinePart):
            self._machines[path] = part
        elif isinstance(part, IteratorPart):
            self._iterators.append(part)
        return part

    def branch_of(self, plan: Any, path: str, parent: Part) -> Part:
        """Make the part of a node directly in an Iterator or a Concurrence."""
        if not isinstance(plan, Leaf):
            return self.part_of(plan, path, parent)
        self._branches.append(BranchPart(self, plan, path, parent))
        return self._branches[-1]

    def between_ends(self, part: Part, branches: List[str], course: Course) -> Course:
        """An execution of an Iterator or a Concurrence; told of where it has branches."""
        told = (lambda *event: self.tell(part.path, event)) if branches else (lambda *event: None)
        told('CONTAINER_START', ', '.join(branches), '', '')
        try:
            outcome = yield from course
        except Raised:
            told('CONTAINER_END', '', '', '')
            raise
        except Jumping:
            told('CONTAINER_END', '', part.left_with, '')
            raise
        told('CONTAINER_END', '', outcome, '')
        return outcome

    def let_go_on(self, machine: MachinePart, target: str) -> None:
        """The oracle goes to a state: an Iterator that has failed or was left goes on there."""
        for part in machine.children():
            if isinstance(part, IteratorPart):
                part.ask_to_go_on(
                    part.label == target and machine.has_stopped_early(part.label, part.ended_with)
                )

    def forget_rests_below(self, part: Part) -> None:
        """Another item begins: what Iterators in it have left was that of the one before."""
        for iterator in self._iterators:
            if part in _with_ancestors(iterator):
                iterator.forget()

    def execute(self) -> str:
        """One trial; returns the outcome, or '' where it raises."""
        self.repeats.begin_trial()
        for kind in self.budget:
            self.budget[kind] = 0
        for machine in [*self._machines.values(), *self._branches]:
            machine.memory.begin_trial()
        for iterator in self._iterators:
            iterator.forget()
        self._numbers = {
            key: number for key, number in self._numbers.items() if key[0] != 'question'
        }
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
        if event[0] == 'DECISION' and event[-1] == 'held_back':
            self._count()
        self.course.append((path, event))

    def _count(self) -> None:
        self.entries += 1
        if self.entries > MOST_ENTRIES:
            raise Cut

    def enter(self, path: str, label: str, seen: Dict[str, Any]) -> None:
        """Note what a leaf sees when it is executed."""
        self._count()
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

    def holder(self, path: str, label: str) -> MachinePart:
        """The machine that holds a place, or the branch that is it."""
        return (
            next(
                (
                    branch
                    for branch in self._branches
                    if (branch.path, branch.label) == (path, label)
                ),
                None,
            )
            or self._machines[path]
        )

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
        if isinstance(inner, BranchPart):
            return False
        if isinstance(level, IteratorPart):
            return self._passes_over(level, inner, outcome)
        if not isinstance(level, MachinePart):
            return False
        failed = level.failure_of(inner.label, outcome, False)
        if failed is None:
            return False
        if level.author_drew(failed):
            return True
        way = failed.way
        return (
            way is not None
            and bool(way.target)
            and not way.is_state
            and self.is_foreseen(level, way.target)
        )

    def _passes_over(self, iterator: IteratorPart, inner: Part, outcome: str) -> bool:
        own = self.plan.of(iterator.path, inner.label).author_recoveries
        return (
            outcome in iterator.plan.loop_outcomes
            and sounds_like_failure(outcome)
            and (own or self.plan.author_recoveries) != 'override'
        )

    def forget_begins(self, part: Part) -> None:
        """What was not entered in the middle is entered at its own start from now on."""
        for machine in self._machines.values():
            if part in _with_ancestors(machine):
                machine.begins_in = None

    def goal_of(self, origin: MachinePart, path: str, label: str) -> Goal:
        """Where to go from a container to a place."""
        target: Part = self.holder(path, label)
        place = label
        around = _with_ancestors(origin)
        begins = {}
        while target not in around or not isinstance(target, MachinePart):
            if isinstance(target, MachinePart) and not isinstance(target, BranchPart):
                begins[target.path] = label
            label = target.label
            target = target.parent
        return Goal(target, label, begins, place=(path, place))

    def is_closed(self, goal: Goal) -> bool:
        """Whether a place, or what lies on the way down to it, cannot be entered."""
        return any(self.repeats.is_closed(place) for place in self.places_on(goal))

    def places_on(self, goal: Goal) -> List[Tuple[str, str]]:
        """The places on the way down to where a goal leads, with its own."""
        return [(goal.machine.path, goal.label), *goal.begins.items(), goal.place]

    def depart(self, origin: Part, goal: Goal) -> Jumping:
        """Have what runs beside the way to a goal preempted; of two jumps the first wins."""
        way, part = [], origin
        while part is not goal.machine:
            if isinstance(part.parent, ConcurrencePart):
                way.append((part.parent, part.label))
            part = part.parent
        if goal.gives_up is None:
            goal = goal._replace(repeats=self.repeats.repeated_by(goal.machine, goal.label))
        goal = next((beside.goal for beside, _ in way if beside.goal is not None), goal)
        for beside, label in way:
            if beside.goal is None and goal.machine in _with_ancestors(beside):
                beside.leave_for(goal, label)
        return Jumping(goal)

    def missing_at(self, goal: Goal, userdata: Dict[str, Any]) -> Tuple[str, ...]:
        """Input keys of a place that are not there, where a goal's machine has this userdata."""
        path, label = goal.place
        machine = self.holder(path, label)
        part = machine.child(label)
        remapping = machine.plan.remappings.get(label, {})
        return tuple(
            sorted(
                key
                for key in getattr(part.plan, 'reads', part.keys)
                if not self._will_have(machine, remapping.get(key, key), goal.machine, userdata)
            )
        )

    def _will_have(self, part: Any, key: str, around: Any, userdata: Dict[str, Any]) -> bool:
        """Whether a container has a key once the machine has come down to it."""
        if part is around:
            return key in userdata
        if isinstance(part, BranchPart):
            return self._will_have(part.parent, key, around, userdata)
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
        places = [
            (each.path, name)
            for each in [*self._machines.values(), *self._branches]
            for name in each.labels
        ]
        levels = [each for each in _with_ancestors(machine) if isinstance(each, MachinePart)]
        places = [place for place in places if not self.is_closed(self.goal_of(machine, *place))]
        missing, repeats = [], []
        for path, name in places:
            goal = self.goal_of(machine, path, name)
            repeated = self.repeats.repeated_by(goal.machine, goal.label)
            if repeated:
                repeats.append((path, name, repeated))
            missing.append(
                (
                    path,
                    name,
                    self.missing_at(
                        goal,
                        goal.machine.after_jump(
                            goal.label, written if goal.machine is machine else set()
                        ),
                    ),
                )
            )
        return Options(
            tuple(sorted(places)),
            tuple(sorted(missing)),
            tuple(sorted(repeats)),
            tuple(
                sorted(
                    (
                        name,
                        machine.leads_to(name)
                        if isinstance(machine, BranchPart)
                        else machine.way_of(label, name).target,
                    )
                    for name in part.plan.outcomes
                )
            ),
            tuple(sorted((each.path, name) for each in levels for name in each.plan.outcomes)),
            tuple(sorted(getattr(part.plan, 'writes', part.keys))),
        )


def _with_ancestors(part: Part) -> List[Part]:
    found = [part]
    while found[-1].parent is not None:
        found.append(found[-1].parent)
    return found
