"""Trees drawn at random that are held, sent and stopped. test/data/pinned/stops.txt has the digests
of what they tell.

    python3 test/unit/support/pinned_stops.py FOLDER [--pin]

does for these trees what pinned_trees.py does for its own. Here any container may be preempted, the
process may go down, and authors lead `preempted` to states. Some states ignore a preempt, and some
service it and go on.
"""

import random
import re
import sys
from functools import partial
from pathlib import Path
from typing import Any, Dict, List, Tuple

HERE = Path(__file__).resolve().parent
if __name__ == '__main__':
    sys.path[:0] = [str(HERE), str(HERE.parents[2] / 'src')]

from pinned_trees import BESIDE, IN_ORDER, Operated, is_beside, name_of, plan_of, write_trees
from tree_model.building import Scripted
from tree_model.plan import TOP, Leaf, Machine, Repeated, TreePlan, children_of, nodes_below

from smach_oracle.oracle.machine.nesting import nodes_of

# the numbers of trees that both engines do alike: in others upstream's engine passes a preempt on
# otherwise, above all to and from Iterators
STOPPED = (1, 2, 3, 4, 5, 6, 7, 9, 11, 13, 14, 17, 19, 20, 22, 23, 26, 27, 29, 30, 33, 34, 35, 36)
STOPPED += (37, 38, 39, 41, 42, 43, 44, 45, 47, 49, 52, 54, 55, 57, 60, 61, 62, 63, 64, 65, 66, 68)
UNOBSERVED = (0, 1, 2, 3, 4, 6, 7, 10, 11, 13, 15, 17, 19, 21, 22, 23, 24, 27, 28, 29, 31, 34, 35)
UNOBSERVED += (37, 38, 39, 40, 41, 42, 43, 45, 46, 47, 49, 50, 51, 52, 53, 54, 55, 56, 57, 59, 60)
TRIALS = 3
LOOPS: Tuple[Tuple[str, ...], ...] = (('ok',), ('ok', 'again'), ())
HELD = re.compile(': (paused|waits for a confirmation).* before ')
MANNERS = ('obeys', 'obeys', 'obeys', 'serves', 'leaves', 'ignores')


class Stopped(Operated):
    """A tree that is stopped, as a whole or in part, while its operator holds it and sends it."""

    HELD = 0.3  # how many states have an autonomy of their own
    ITEMS = 0.15  # how many leafs an Iterator has instead
    BESIDE = False  # whether some trees have Concurrences

    def __init__(self, number: int) -> None:
        plan = plan_of(number, BESIDE if self.BESIDE and is_beside(number) else IN_ORDER)
        self._stops = random.Random(plan.seed + ' stopped')
        self._checked = {check.name for own in plan.states.values() for check in own.preconditions}
        plan = plan._replace(top=self._with_items(plan.top))
        super().__init__(self._with_clean_ups(plan))
        for node in nodes_of(self.machine):
            for state in self._leafs(node.machine):
                state.at_preempt = self._stops.choice(MANNERS)

    def _leafs(self, machine: Any) -> List[Scripted]:
        children = list(machine._states.values())
        found = []
        while children:
            child = children.pop()
            if isinstance(child, Scripted):
                found.append(child)
            elif not hasattr(child, '_transitions') and hasattr(child, 'get_children'):
                children += child.get_children().values()
        return found

    def _with_items(self, node: Any) -> Any:
        """The same node, in which some leafs of machines became Iterators of a leaf."""
        if isinstance(node, Leaf):
            return node
        if isinstance(node, Repeated):
            return node._replace(child=self._with_items(node.child))
        children = []
        for child in node.children:
            is_kept = child.label in self._checked or self._stops.random() >= self.ITEMS
            if isinstance(child, Leaf) and isinstance(node, Machine) and not is_kept:
                items, loops = self._stops.choice((2, 3, 5)), self._stops.choice(LOOPS)
                leaf = child._replace(label='X' + child.label)
                keys = tuple(dict.fromkeys(leaf.reads + leaf.writes))
                child = Repeated(child.label, leaf.outcomes, leaf, items, loops, {}, keys)
            children.append(self._with_items(child))
        return node._replace(children=tuple(children))

    def _with_clean_ups(self, plan: TreePlan) -> TreePlan:
        """The same plan, in which authors lead some outcomes `preempted` to a state."""
        for _, machine in nodes_below(TOP, plan.top):
            if isinstance(machine, Machine):
                labels = [child.label for child in machine.children]
                for index, child in enumerate(machine.children[:-1], 1):
                    if 'preempted' in child.outcomes and self._stops.random() < 0.6:
                        target = self._stops.choice(labels[index:])
                        machine.transitions[child.label]['preempted'] = target
        return plan

    def settings(self) -> Dict[str, Any]:
        settings = super().settings()
        for path, node in nodes_below(TOP, self.plan.top):
            for child in children_of(node):
                has_oracle = isinstance(node, Machine) or isinstance(child, Leaf)
                if has_oracle and self._stops.random() < self.HELD:
                    name = '{}/{}'.format(path, child.label)[len(TOP) + 1 :]
                    level = self._stops.choice(('announce', 'confirm'))
                    settings['states'].setdefault(name, {})['autonomy'] = level
        return settings

    def execute(self) -> str:
        outcome = super().execute()
        self.tell('USERDATA', dict(self.machine.userdata._data))
        return outcome

    def _tell(self, event: Any) -> None:
        super()._tell(event)
        if event.kind.name in ('STATE_START', 'HOLD_START') and self._stops.random() < 0.15:
            self._stop()

    def _stop(self) -> None:
        """Preempt a container, or the operator's stop, or a shutdown."""
        drawn = self._stops.random()
        if drawn < 0.05:
            self.tell('SHUTDOWN', '')
            self.world.is_cut = True
        elif drawn < 0.4:
            self._say(partial(self._hand.preempt, 'eva'))
        else:
            machine = self._stops.choice(nodes_of(self.machine)).machine
            self.tell('PREEMPTED', machine._oracle.path)
            machine.request_preempt()


class Unobserved(Stopped):
    """Nobody observes it, so that what goes well takes the short way. Commands come at the leafs.

    What the log says of a hold comes in the thread of the machine, too.
    """

    COMMANDS, HELD, ITEMS, BESIDE = 0.06, 0.05, 0.5, True
    LOGS_TRANSITIONS = True

    def __init__(self, number: int) -> None:
        if is_beside(number):  # then threads give commands at no certain moment
            self.COMMANDS = self.HELD = 0
        super().__init__(number)
        self.machine.events.observers.clear()
        self.world.at_entry = self._enter

    def _enter(self) -> None:
        self.tell('ENTRY', self.world.course[-1])
        if self._chance.random() < self.COMMANDS:
            self._command()
        if self._stops.random() < self.COMMANDS:
            self._stop()

    def tell(self, what: str, value: Any) -> None:
        super().tell(what, value)
        if what == 'WARN' and HELD.search(value):
            self._held()


def tell(number: int) -> List[str]:
    """Return what a tree tells in some trials."""
    told = Stopped(number)
    told.run(TRIALS)
    return told.lines


def tell_unobserved(number: int) -> List[str]:
    """Return what a tree tells that nobody observes."""
    told = Unobserved(number)
    told.run(TRIALS)
    return sorted(told.lines) if is_beside(number) else told.lines


def write(folder: Path, pins: bool) -> None:
    """Write what all trees tell, a file each. `pins`: the digests, too."""
    told = {name_of(number, 'stopped'): tell(number) for number in STOPPED}
    for number in UNOBSERVED:
        told[name_of(number, 'unobserved')] = tell_unobserved(number)
    write_trees('stops', told, folder, pins)


if __name__ == '__main__':
    write(Path(sys.argv[1]), '--pin' in sys.argv)
