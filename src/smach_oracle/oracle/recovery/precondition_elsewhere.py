"""A state of another container of the tree, run as a precondition.

It runs on the userdata of its own container. The containers on the way down to it get their input
keys, as if they began. Once it has ended well, what it wrote goes up through their output keys, and
down through the input keys of the containers around the failed state.
"""

from typing import Any, Dict, List, Tuple

from ..machine.jump_path import JumpPath, hand_down, hand_on, hand_up, jump_path_to
from ..machine.places import TreePlace, links_to
from ..machine.snapshots import UserdataGate, WriteWatch
from ..machine.tree_node import TreeNode
from ..settings.settings import ALLOW


class NotMet(Exception):
    """A precondition is not met. The text says why. This error never leaves its package."""


class RunElsewhere:
    """One run of a state of another container than that of the failed state."""

    def __init__(self, node: TreeNode, place: TreePlace, own: UserdataGate) -> None:
        """`node`: the failed state's container. `own`: what its userdata is written through.

        :raises NotMet: where the state cannot be run now.
        """
        way = jump_path_to(node, place)
        if way is None:
            raise NotMet('{} is in no container that is being executed'.format(place.path))
        _check(way)
        self._own = own
        self._userdata = node.machine.userdata
        self._down = [link for below in way.down[1:] for link in links_to(below.node)]
        self._on = [link for left in reversed(way.left) for link in links_to(left)]
        self._runs = not way.down[1:]  # whether its container is one around the failed state
        self._watch = WriteWatch(place.node.machine, place.node.in_force.deep_copy_keys)
        self._begun = self._watch.begin()
        self._before: List[Tuple[Dict[str, object], Dict[str, object]]] = [
            (link.below.userdata._data, dict(link.below.userdata._data)) for link in self._down[:-1]
        ]
        self.gate = self._watch.gate
        for link in self._down:
            hand_down(link)

    def take_back(self) -> None:
        """Make the userdata what it was."""
        if self._runs:
            self._watch.take_back_own(self._begun)
            return
        self._watch.take_back(self._begun)
        for data, before in self._before:
            data.clear()
            data.update(before)

    def hand_over(self) -> None:
        """Hand what the state wrote to the container of the failed state, as its author says."""
        written = set(self.gate.written)
        for link in reversed(self._down):
            written = hand_up(link, written, self._writer_of(link.above))
        for link in self._on:
            written = hand_on(link, written, self._writer_of(link.below))

    def _writer_of(self, container: Any) -> Any:
        return self._own if container.userdata is self._userdata else container.userdata


def _check(way: JumpPath) -> None:
    for place in way.down[1:]:
        if place.node.machine._is_running:
            raise NotMet('{} runs at this time'.format(place.node.path))
    for place in way.down[:-1]:
        guarded = place.node.settings_of(place.label).on_retry != ALLOW
        if guarded and place.node.records.marks.of(place.label).done:
            raise NotMet(
                '{} was done in this trial and is not repeated by itself'.format(place.path)
            )
