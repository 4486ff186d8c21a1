"""Iterators of a wrapped tree: which item is under way, and where one goes on."""

from typing import Callable, Dict, Iterator, Mapping, Optional, Tuple, cast

import smach

from ..decision.ways import RESTORE
from ..machine.items import TrackedItems
from ..machine.nesting import children_of, containers_of, machines_below
from ..machine.tree_node import TreeNode, node_of
from ..machine.userdata import restore
from ..recovery.failure import Failure, judge
from ..settings.failing_outcomes import is_preempted
from ..smach_private import Labels, data_of, items_of, mark_on
from .wrapper import ContainerWrapper, wrapper_of


class IteratorWrapper(ContainerWrapper):
    """The data kept for an Iterator."""

    container: smach.Iterator

    def __init__(self, container: smach.Container, parent: TreeNode, labels: Labels) -> None:
        super().__init__(container, parent, labels)
        self._trial_id = ''  # that of `tracked`
        self._rounds = 0  # how often it has begun again
        self._inside: Tuple[Tuple[int, int], ...] = ()  # marks of the Iterators around it then
        self._given: Dict[str, object] = {}  # its io keys when it began
        self.at_item: Optional[Dict[str, object]] = None  # its userdata as the item under way began
        self._ended_with: Optional[str] = None  # None: an error, or it was left
        # the next execution goes on where the one before has stopped, else it begins again
        self.is_asked_to_go_on = False
        self.goes_on = False
        self.is_left = False  # for a place elsewhere. `execution.departure` sets it

    # -- going on

    def has_stopped_early(self, node: TreeNode, label: str) -> bool:
        """Whether it has failed or was left, when it was executed last."""
        outcome = self._ended_with
        return (
            outcome is None
            or is_preempted(outcome)
            or isinstance(judge(node, node.record(label), outcome, None), Failure)
        )

    def items(self, container: smach.Container, items: object) -> object:
        """Return what the Iterator goes through in place of its items."""
        is_own = container is self.container and self._is_in_use
        return self.tracked if is_own and self.tracked is not None else items

    def _begin(self) -> None:
        """Find out where it begins, and whether it goes on."""
        items, trial_id = self.tracked, self.parent.tree.trial_id
        inside = tuple(wrapper.mark() for wrapper in self._iterators_around())
        if items is None or items.given is not items_of(self.container):
            items = TrackedItems(items_of(self.container), self._tell)
        has_items_left = items.has_items_left() and (trial_id, inside) == (
            self._trial_id,
            self._inside,
        )
        self.goes_on = items.goes_on = self.is_asked_to_go_on and has_items_left
        self.is_asked_to_go_on = False
        if has_items_left and self._ended_with is None and not self.goes_on:
            items.tell_of_repeats()
        resumed = self._to_resume()
        items.begins_with = 1 if resumed is None else resumed.item
        # a branch notes by itself that an item begins
        items.begins = None if self.branches else self.begin_item
        if self.goes_on:
            self._pass_on()
        else:
            self._rounds += 1
        self.tracked, self._trial_id, self._ended_with = items, trial_id, None
        self.is_left = False
        self._inside = inside
        for branch in self.branches.values():
            branch.begin(self)

    def mark(self) -> Tuple[int, int]:
        """Return what is different for each item: its number, and that of the round."""
        return self._rounds, self.item_number

    def _iterators_around(self) -> Iterator['IteratorWrapper']:
        node: Optional[TreeNode] = self.parent
        labels: Tuple[str, ...] = self.labels_from_parent
        while node is not None:
            container: object = node.machine
            for label in labels[:-1]:
                container = children_of(container)[label]
                wrapper = wrapper_of(container)
                if isinstance(wrapper, IteratorWrapper):
                    yield wrapper
            labels = node.labels_from_parent
            node = node.parent

    def _pass_on(self) -> None:
        """Let an Iterator directly inside go on too, where its items belong to the unfinished one.

        It sees that by the mark of this one.
        """
        for _, state in self.states():
            inner = wrapper_of(state)
            if isinstance(inner, IteratorWrapper):
                inner.is_asked_to_go_on = True

    def _tell(self, text: str) -> None:
        self.parent.warn(text, '/'.join(self.labels_from_parent))

    def begin_item(self) -> None:
        """Note that an item begins."""
        data: Mapping[str, object] = data_of(self.container.userdata)
        for branch in self.branches.values():
            node: TreeNode = mark_on(branch)
            record = node.records.by_label.get(node.site.label)
            unfinished = None if record is None else node.tree.resumed.unfinished(record)
            if unfinished is not None and unfinished.snapshot is not None:
                data = unfinished.snapshot  # before the program was stopped: it has written since
        self.at_item = self.parent.snapshot(data)

    def _leave(self, outcome: object, error: Optional[BaseException]) -> None:
        """Tell that the container has ended, and let its states execute by themselves again."""
        self._ended_with = outcome if isinstance(outcome, str) and not self.is_left else None
        if cast('TrackedItems', self.tracked).is_finished:
            # the author has gone on behind the item where an oracle has given up
            for _, machine in machines_below(self.container):
                node = node_of(machine)
                if node is not None:
                    node.execution.forget_unrecovered()
        super()._leave(outcome, error)

    def __getstate__(self) -> Dict[str, object]:
        return dict(
            super().__getstate__(),
            tracked=None,
            goes_on=False,
            _ended_with=None,
            _given={},
            at_item=None,
        )

    # -- userdata

    def take_inputs(
        self,
        container: smach.Container,
        copy: Callable[[], None],
        parent_ud: Optional[smach.UserData],
    ) -> None:
        """Take the inputs, but keep what finished items have left, where it goes on."""
        kept = self._keys_to_keep(parent_ud) if container is self.container else {}
        super().take_inputs(container, copy, parent_ud)
        for key, value in kept.items():
            container.userdata[key] = value

    def _keys_to_keep(self, userdata: Optional[smach.UserData]) -> Dict[str, object]:
        """Return the values of its keys that its inputs do not replace, as it begins or goes on.

        What finished items have left under keys that are inputs and outputs stays where the
        container above has the value again with which the Iterator began. What the unfinished item
        wrote is taken back.

        `userdata`: what the inputs are copied from.
        """
        iterator, own, parent = self.container, data_of(self.container.userdata), self.parent
        both = set(iterator.get_registered_input_keys()).intersection(
            iterator.get_registered_output_keys()
        )
        given = {} if userdata is None else {key: userdata[key] for key in both if key in userdata}
        if not self.goes_on:
            self._given = parent.snapshot(given)
            return {}
        if (
            not cast('TrackedItems', self.tracked).is_finished
            and self.at_item is not None
            and parent.in_force.userdata == RESTORE
        ):
            restore(own, self.at_item, (), parent.in_force.deep_copy_keys)
        return {
            key: own[key]
            for key, value in given.items()
            if key in own and key in self._given and _same(self._given[key], value)
        }


def _same(one: object, other: object) -> bool:
    if one is other:
        return True
    try:
        return type(one) is type(other) and bool(one == other)
    except Exception:  # whatever a user's object raises, or an array that is no truth
        return False


def ask_to_go_on(node: TreeNode, target: str) -> None:
    """Note that the oracle goes to a state: an Iterator that has failed or was left goes on there.

    Any other Iterator of the container begins again when it is entered.
    """
    for label, state in containers_of(node.machine):
        wrapper = wrapper_of(state)
        if isinstance(wrapper, IteratorWrapper):
            goes_there = label == target
            wrapper.is_asked_to_go_on = goes_there and wrapper.has_stopped_early(node, label)
