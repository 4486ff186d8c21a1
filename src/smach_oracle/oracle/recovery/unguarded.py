"""The ways through a tree on which no state is executed that is not to be repeated (`on_retry`).

They are told by what is drawn, before anything runs.
"""

from typing import Dict, FrozenSet, Iterator, List, Set, Tuple

import smach

from ..machine.nesting import nodes_of
from ..machine.places import links_to
from ..machine.site import route_of
from ..machine.tree_node import TreeNode
from ..settings.settings import ALLOW
from ..smach_private import initial_label_of, states_of, transitions_of
from .menu import Drawn

_Place = Tuple[TreeNode, str]


class Unguarded:
    """The ways through one tree. It looks at each state once."""

    def __init__(self, top: TreeNode) -> None:
        self._ends: Dict[_Place, FrozenSet[str]] = {}
        self._within: Dict[_Place, List[TreeNode]] = {}
        for each in nodes_of(top.machine):
            # an Iterator may have no item, and then executes nothing
            if each.parent is not None and not _is_in_iterator(each):
                place = each.parent, each.labels_from_parent[0]
                self._within.setdefault(place, []).append(each)

    def transitions(self, node: TreeNode) -> Drawn:
        """Return the transitions that a container may take so, by state and outcome."""
        drawn = transitions_of(node.machine)
        return {
            label: {
                outcome: target
                for outcome, target in drawn.get(label, {}).items()
                if outcome in self.ends(node, label)
            }
            for label in node.labels()
        }

    def ends(self, node: TreeNode, label: str) -> FrozenSet[str]:
        """Return the outcomes with which a state may end so."""
        place = node, label
        if place not in self._ends:
            self._ends[place] = frozenset(self._ends_of(node, label))
        return self._ends[place]

    def _ends_of(self, node: TreeNode, label: str) -> Set[str]:
        if node.settings_of(label).on_retry != ALLOW:
            return set()
        state = states_of(node.machine)[label]
        found = set(state.get_registered_outcomes())
        for each in self._within.get((node, label), ()):
            ends = set(self._ends_within(each))
            if isinstance(state, smach.StateMachine):
                return ends
            if not ends:  # all branches of a Concurrence run
                return set()
        return found

    def _ends_within(self, node: TreeNode) -> Iterator[str]:
        """Yield the outcomes with which a container may end so, or the branch of a Concurrence."""
        if not node.site.is_container:
            for label in node.labels():
                yield from self.ends(node, label)
            return
        met = [initial_label_of(node.machine)]
        for label in met:
            for outcome in self.ends(node, label):
                route = route_of(node.machine, label, outcome)
                if not route.is_state:
                    yield route.target
                elif route.target not in met:
                    met.append(route.target)


def _is_in_iterator(node: TreeNode) -> bool:
    return any(isinstance(link.inner_container, smach.Iterator) for link in links_to(node))
