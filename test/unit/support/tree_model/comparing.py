"""One tree, both ways: where the courses part."""

import itertools
import threading
from typing import Any, Dict, List, NamedTuple, Optional, Set, Tuple

from .executing import Executed
from .model import Model
from .parts import Unsaid
from .plan import CUT, TOP, Beside, Leaf, Repeated, TreePlan, children_of, nodes_below
from .turns import Hang

TRIAL_S = 60.0  # no trial takes so long


class Difference(NamedTuple):
    """The first event of a container that is not the same."""

    path: str
    number: int
    model: Any
    executed: Any


class Comparison(NamedTuple):
    """How the trials of one tree went."""

    plan: TreePlan
    model: Model
    executed: Executed
    outcomes: Tuple[Tuple[str, str], ...]  # the model's and the executive's, by trial
    difference: Optional[Difference]
    is_hung: bool
    still_running: bool
    threads_left: Tuple[str, ...]

    @property
    def is_fine(self) -> bool:
        """Whether nothing is wrong."""
        return not (
            self.difference
            or self.is_hung
            or self.still_running
            or self.threads_left
            or any(mine != theirs for mine, theirs in self.outcomes)
        )

    def report(self) -> str:
        """What is wrong: the seed, and both courses up to where they part, and a little on."""
        lines = [
            'seed {}: outcomes (model, executive) {}{}{}'.format(
                self.plan.seed,
                self.outcomes,
                ', hung' if self.is_hung else '',
                ', threads left: {}'.format(self.threads_left) if self.threads_left else '',
            )
        ]
        if self.difference:
            path, number, mine, theirs = self.difference
            courses = [
                _by_path(self.plan, course, bool(path)).get(path, [])
                for course in (self.model.course, self.executed.course)
            ]
            lines += ['  {}'.format(event) for event in courses[0][max(0, number - 12) : number]]
            for name, course in zip(('model', 'executive'), courses):
                lines += [
                    '  {:9} {}'.format(name, event)
                    for event in course[number : number + 4] or ['(nothing more)']
                ]
        return '\n'.join(lines)


def compare(plan: TreePlan, is_upstream: bool, trials: int = 2) -> Comparison:
    """Execute a tree, as often, by the executive and by the model."""
    before = set(threading.enumerate())
    model, executed = Model(plan, is_upstream), Executed(plan)
    outcomes = []
    is_hung = False
    for _ in range(trials):
        said = in_time(executed)
        if said is None:
            is_hung = True
            break
        outcomes.append((model.execute(), said))
        if outcomes[-1][0] != outcomes[-1][1] or CUT in outcomes[-1]:
            break
    return Comparison(
        plan,
        model,
        executed,
        tuple(outcomes),
        difference_of(plan, model.course, executed.course),
        is_hung,
        executed.machine.is_running(),
        threads_left(before),
    )


def in_time(executed: Executed) -> Optional[str]:
    """The outcome of a trial; None where it hangs. It runs in a thread of its own."""
    said: List[str] = []

    def run() -> None:
        try:
            said.append(executed.execute())
        except Hang as hang:
            said.append('hang {}'.format(hang))
        except Exception as err:
            said.append('raised {!r}'.format(err))

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    thread.join(TRIAL_S)
    return said[0] if said else None


def difference_of(plan: TreePlan, model: List[Any], executed: List[Any]) -> Optional[Difference]:
    """Where two courses part first; those of containers that run at the same time each alone."""
    is_concurrent = any(isinstance(node, Beside) for _, node in nodes_below(TOP, plan.top))
    mine, theirs = (_by_path(plan, course, is_concurrent) for course in (model, executed))
    found = []
    for path in sorted(set(mine) | set(theirs)):
        pairs = itertools.zip_longest(mine.get(path, ()), theirs.get(path, ()))
        for number, (one, other) in enumerate(pairs):
            if not _is_same(one, other):
                found.append(Difference(path, number, one, other))
                break
    return min(found, key=lambda each: _moment(plan, model, is_concurrent, each)) if found else None


def _moment(plan: TreePlan, model: List[Any], is_concurrent: bool, difference: Difference) -> int:
    """Where in the model's whole course a difference comes."""
    if not is_concurrent:
        return difference.number
    branches = _branches_of(plan)
    places = [
        place
        for place, (path, event) in enumerate(model)
        if _course_of(path, event, branches) == difference.path
    ]
    return (places + [len(model)])[min(difference.number, len(places))]


def _is_same(one: Any, other: Any) -> bool:
    """Whether two events are the same; rates differ in their last places."""
    if one is None or other is None or len(one) != len(other):
        return one == other
    return all(
        abs(mine - theirs) < 1e-9
        if isinstance(mine, float) and isinstance(theirs, float)
        else mine == theirs or isinstance(mine, Unsaid) and mine.also == theirs
        for mine, theirs in zip(one, other)
    )


def _by_path(plan: TreePlan, course: List[Any], is_concurrent: bool) -> Dict[str, List[Any]]:
    branches = _branches_of(plan)
    by_path: Dict[str, List[Any]] = {}
    for path, event in course:
        name = _course_of(path, event, branches) if is_concurrent else ''
        by_path.setdefault(name, []).append((path,) + tuple(event))
    return by_path


def _branches_of(plan: TreePlan) -> Set[Tuple[str, str]]:
    """The places of the branches, each of which goes its own way."""
    return {
        (path, child.label)
        for path, node in nodes_below(TOP, plan.top)
        if isinstance(node, (Beside, Repeated))
        for child in children_of(node)
        if isinstance(child, Leaf)
    }


def _course_of(path: str, event: Any, branches: Set[Tuple[str, str]]) -> str:
    """The path of the container that an event is of, or of its branch."""
    return (
        '/'.join((path, event[1]))
        if (path, event[1]) in branches and not event[0].startswith('CONTAINER')
        else path
    )


def threads_left(before: Any) -> Tuple[str, ...]:
    """Names of threads that have not ended soon."""
    left = [thread for thread in threading.enumerate() if thread not in before]
    for thread in left:
        thread.join(2.0)
    return tuple(thread.name for thread in left if thread.is_alive())
