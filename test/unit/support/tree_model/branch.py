"""The model's branches: plain states of Iterators and Concurrences, each with an oracle."""

from typing import Any, Dict, Optional, Set

from .ends import Failed, Way
from .iterating import IteratorPart
from .machine import MachinePart
from .parts import ConcurrencePart, Part, View
from .plan import Leaf, Machine
from .scheduling import Course
from .words import sounds_like_failure


class BranchPart(MachinePart):
    """A leaf, as if it were alone in a machine whose outcomes are its own."""

    def __init__(self, run: Any, leaf: Leaf, path: str, parent: Any) -> None:
        """`path`: of the Iterator or Concurrence that is the parent."""
        super().__init__(
            run, Machine(leaf.label, leaf.outcomes, (leaf,), {leaf.label: {}}, {}, ()), path, parent
        )
        self.leaf = leaf
        self.userdata = parent.userdata  # the same: what a branch writes is seen at once

    def execute(self, view: View) -> Course:
        """Run to the end, on the userdata of the parent; returns the outcome."""
        return super().execute(View({}, {}))

    def tell(self, kind: str, label: str, outcome: str = '', target: str = '', *more: Any) -> None:
        """Note an event; its beginning and end are those of the parent."""
        if not kind.startswith('CONTAINER'):
            super().tell(kind, label, outcome, target, *more)

    def failure_of(self, label: str, outcome: Any, raised: bool) -> Optional[Failed]:
        """As of any state; but the parent goes on with an outcome that is not registered."""
        failed = super().failure_of(label, outcome, raised)
        if failed and failed.kind == 'UNREGISTERED_OUTCOME' and isinstance(outcome, str):
            way = Way(outcome, False)
            return failed._replace(way=way, ending=way)
        return failed

    def author_recovers(self, failed: Failed) -> bool:
        """Whether the author of the parent has foreseen it."""
        own = self.settings_of(failed.label).author_recoveries
        if (own or self.run.plan.author_recoveries) == 'override':
            return False
        if self.stops_others(failed):
            return True
        if failed.way is None:
            return False
        if isinstance(self.parent, IteratorPart):
            plan = self.parent.plan
            return failed.outcome in plan.loop_outcomes or (
                failed.outcome in plan.final_map
                and not _is_failure(self.parent, plan.final_map[failed.outcome])
            )
        return any(
            wanted.get(self.label) == failed.outcome and not _is_failure(self.parent, name)
            for name, wanted in self.parent.plan.outcome_map.items()
        )

    def only_watches(self) -> bool:
        """A plain state ends its branch as it fails, whatever it is."""
        return isinstance(self.parent, ConcurrencePart)

    def after_jump(self, target: str, written: Set[str]) -> Dict[str, Any]:
        """The userdata that a retry leaves: that of a Concurrence stays live."""
        if isinstance(self.parent, ConcurrencePart):
            return dict(self.userdata)
        return super().after_jump(target, written)

    def restores(self, target: str) -> bool:
        return not isinstance(self.parent, ConcurrencePart) and super().restores(target)

    def keys_of_states(self) -> Set[str]:
        return set(self.userdata)  # an item's state has all of them in its hands

    def holds_paths(self) -> bool:
        return False  # its path is that of the parent

    def leads_to(self, outcome: str) -> str:
        """Where an outcome leads, in the words of doc/trees.md."""
        if isinstance(self.parent, ConcurrencePart):
            return 'the end of this branch'
        plan = self.parent.plan
        if outcome in plan.loop_outcomes:
            return 'the next item'
        return 'the end of the iteration, with ' + plan.final_map.get(outcome, outcome)


def _is_failure(container: Part, outcome: str) -> bool:
    """Whether an outcome of an Iterator or a Concurrence is a failure above it."""
    above = container.parent
    if isinstance(above, MachinePart):
        return above.failure_of(container.label, outcome, False) is not None
    return sounds_like_failure(outcome)
