"""Concurrences and Iterators of a wrapped tree: their branches, and where an Iterator goes on."""

import threading
from typing import (
    Any,
    Callable,
    Dict,
    Iterable,
    Iterator,
    List,
    Mapping,
    NamedTuple,
    Optional,
    Sequence,
    Tuple,
    cast,
)

import smach

from ..identity import own_mark
from ..machine.execution import why_no_outcome
from ..machine.nesting import BORDER, machines_below
from ..machine.tree_node import TreeNode, WrappedMachine, node_of
from ..records.events import EventKind
from ..records.facts import BRANCHES
from ..settings.failing_outcomes import is_preempted
from .branch import loops
from .branch_machine import BranchMachine
from .item_userdata import ItemUserdata
from .items import TrackedItems
from .stand_in import StandIn, real


class _ResumedItem(NamedTuple):
    """The values with which a container that was under way goes on. See `Border.resume`."""

    keys: Dict[str, Any]
    gone: Tuple[str, ...]
    item: int
    tell: Callable[[Mapping[str, Any]], None]
    trial_id: str


class Border:
    """The data kept for a Concurrence or an Iterator of a wrapped tree.

    `machines`: the hidden machines of its branches, by label. It takes their states' places while
    the container executes, once at a time.
    """

    def __init__(self, container: smach.Container) -> None:
        self.container: Any = container
        self.machines: Dict[str, WrappedMachine] = {}
        self.top: Optional[TreeNode] = None  # the node of the wrapped machine around it
        self.below: Tuple[str, ...] = ()  # labels that lead to it from there
        self._lock = threading.Lock()
        self._is_in_use = False
        self._resumed: Optional[_ResumedItem] = None

    def in_words(self) -> str:
        """Return which item is under way, such as 'item 2 of 4', or '' where none is."""
        return ''

    def nodes(self) -> List[TreeNode]:
        """Return the nodes of its branches."""
        return [machine._oracle for machine in self.machines.values()]

    def enter(self) -> bool:
        """Put the branches in their places.

        Return False where that cannot be, so that it runs bare.
        """
        with self._lock:
            nodes = self.nodes()
            if self._is_in_use or not self._runs_in_tree():
                return False
            self._is_in_use = True
        for node in nodes:
            self._renew(node)
            node.begin_execution()
        if nodes:
            nodes[0].emit(
                EventKind.CONTAINER_START,
                state=', '.join(self.machines),
                data={BRANCHES: list(self.machines)},
            )
        self._take_places()
        return True

    # -- going on after the program was stopped

    def resume(
        self,
        keys: Mapping[str, Any],
        gone: Iterable[str],
        item: int,
        tell: Callable[[Mapping[str, Any]], None],
    ) -> None:
        """Have this userdata at the next execution, once its inputs are copied.

        `gone`: keys that are not to be there. `item`: number of the one to begin with, from 1.
        0 means the first. `tell`: takes the userdata as they are then.
        """
        self._resumed = _ResumedItem(dict(keys), tuple(gone), item, tell, self._trial_now())

    def forget_resumed(self) -> None:
        """Begin the next execution from the start, whatever was under way in the program before."""
        self._resumed = None

    @property
    def is_resumed(self) -> bool:
        """Whether its next execution goes on where the program was stopped."""
        return self._to_resume() is not None

    def _to_resume(self) -> Optional[_ResumedItem]:
        """Return how it goes on, unless that was of a trial before."""
        resumed = self._resumed
        return resumed if resumed is not None and resumed.trial_id == self._trial_now() else None

    def take_over_userdata(self) -> None:
        """Have the userdata that `resume` was given, at the first execution after it."""
        resumed, self._resumed = self._to_resume(), None
        if resumed is not None:
            data = self.container.userdata._data
            for key in resumed.gone:
                data.pop(key, None)
            data.update(resumed.keys)
            resumed.tell(data)

    def _trial_now(self) -> str:
        return self.top.tree.trial_id if self.top is not None else ''

    def _runs_in_tree(self) -> bool:
        top = self.top
        return top is not None and (top.machine._is_running or top.has_running_ancestor())

    def _renew(self, node: TreeNode) -> None:
        machine = cast(BranchMachine, node.machine)
        label = machine._branch_label
        machine.take(self._state_of(label), self.container.userdata, self._remapping_of(label))

    def tell_cause(self, error: BaseException) -> None:
        """Have an error of the container say that a branch has ended the program by it."""
        if self.top is not None and isinstance(error, smach.InvalidStateError):
            error.__cause__ = error.__cause__ or self.top.tree.early_end.of_program

    def ended(self, outcome: object, error: Optional[BaseException]) -> None:
        """Tell that the container has ended, with an outcome or an error."""
        nodes = self.nodes()
        if nodes:
            nodes[0].emit(
                EventKind.CONTAINER_END,
                text=why_no_outcome(outcome, error),
                outcome=outcome if isinstance(outcome, str) else '',
            )

    def leave(self) -> None:
        """Give the states their places back."""
        self._give_places_back()
        with self._lock:
            self._is_in_use = False

    def states(self) -> Iterator[Tuple[str, smach.State]]:
        """Yield the user's states by label."""
        children: Mapping[str, Optional[smach.State]] = self.container.get_children()
        yield from ((label, state) for label, state in list(children.items()) if state is not None)

    def _state_of(self, label: str) -> smach.State:
        return dict(self.states())[label]

    def _remapping_of(self, label: str) -> Mapping[str, str]:
        raise NotImplementedError

    def _take_places(self) -> None:
        raise NotImplementedError

    def _give_places_back(self) -> None:
        raise NotImplementedError

    def without_places(self, attributes: Dict[str, Any]) -> Dict[str, Any]:
        """Return the attributes of its container for a copy, as they are while it is at rest."""
        raise NotImplementedError

    def __getstate__(self) -> Dict[str, Any]:
        state = dict(self.__dict__, _is_in_use=False)
        del state['_lock']
        return state

    def __setstate__(self, state: Dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._lock = threading.Lock()


class ConcurrenceBorder(Border):
    """The data kept for a Concurrence."""

    _own: Optional[Dict[str, Any]] = None  # its table of states, while another has its place

    def _remapping_of(self, label: str) -> Mapping[str, str]:
        return self.container._remappings[label]

    def _take_places(self) -> None:
        own = self._own = self.container._states
        self.container._states = {
            label: StandIn(state, self.machines[label], _forget)
            if label in self.machines
            else state
            for label, state in own.items()
        }

    def _give_places_back(self) -> None:
        self.container._states, self._own = self._own, None

    def without_places(self, attributes: Dict[str, Any]) -> Dict[str, Any]:
        """Return the attributes of its container for a copy, as they are while it is at rest."""
        return attributes if self._own is None else dict(attributes, _states=self._own)

    def __getstate__(self) -> Dict[str, Any]:
        return dict(super().__getstate__(), _own=None)


class IteratorBorder(Border):
    """The data kept for an Iterator."""

    def __init__(self, container: smach.Container) -> None:
        super().__init__(container)
        self._items: Optional[TrackedItems] = None
        self._trial_id = ''  # that of `_items`
        self._rounds = 0  # how often it has begun again
        self._inside: Tuple[Tuple[int, int], ...] = ()  # marks of the Iterators around it then
        self._userdata = ItemUserdata(container)
        self._ended_with: Optional[str] = None  # None: an error, or it was left
        self._is_left = False
        self._is_asked_to_go_on = False
        self.goes_on = False

    def in_words(self) -> str:
        """Return which item is under way, such as 'item 2 of 4', or '' where none is."""
        return self._items.in_words() if self._is_in_use and self._items is not None else ''

    @property
    def item_number(self) -> int:
        """Return the number of the item under way, from 1. 0 means none is."""
        return self._items.number if self._is_in_use and self._items is not None else 0

    # -- going on

    def ask_to_go_on(self, go_on: bool) -> None:
        """Let the next execution go on where the one before has stopped, or begin again."""
        self._is_asked_to_go_on = go_on

    def outcome_before(self) -> Optional[str]:
        """Return how the execution before has ended. None means by an error, or it was left."""
        return self._ended_with

    def note_left(self) -> None:
        """Note that it is left for a state elsewhere: the outcome it gets is no word of its own."""
        self._is_left = True

    def _remapping_of(self, label: str) -> Mapping[str, str]:
        return {}

    def _take_places(self) -> None:
        iterator = self.container
        items, trial_id = self._items, self._trial_now()
        inside = tuple(border.mark() for border in self._iterators_around())
        if items is None or items.given is not iterator._items:
            items = TrackedItems(iterator._items, self._tell)
        has_rest = items.has_rest() and (trial_id, inside) == (self._trial_id, self._inside)
        self.goes_on = items.goes_on = self._is_asked_to_go_on and has_rest
        self._is_asked_to_go_on = False
        if has_rest and self._ended_with is None and not self.goes_on:
            items.tell_of_repeats()
        resumed = self._to_resume()
        items.begins_with = 1 if resumed is None else resumed.item
        if self.goes_on:
            self._pass_on(dict(self.states()))
        else:
            self._rounds += 1
        self._items, self._trial_id, self._ended_with = items, trial_id, None
        self._is_left = False
        self._inside = inside
        iterator._items = items
        state = iterator._state
        if state is not None:
            iterator._state = StandIn(
                state,
                self.machines.get(iterator._state_label),
                self._note_outcome,
                self._begin_item,
            )

    def mark(self) -> Tuple[int, int]:
        """Return what is different for each item: its number, and that of the round."""
        return self._rounds, self._items.number if self._items is not None else 0

    def _iterators_around(self) -> Iterator['IteratorBorder']:
        node: Optional[TreeNode] = self.top
        below: Tuple[str, ...] = self.below
        while node is not None:
            container: Any = node.machine
            for label in below[:-1]:
                container = _children_of(container)[label]
                border = border_of(container)
                if isinstance(border, IteratorBorder):
                    yield border
            below = node.below
            node = node.parent

    def _pass_on(self, states: Mapping[str, smach.State]) -> None:
        """Let an Iterator directly inside go on too: its items belong to the unfinished one."""
        for state in states.values():
            inner = border_of(state)
            if isinstance(inner, IteratorBorder) and self._items is not None:
                inner.ask_to_go_on(not self._items.is_finished)

    def _tell(self, text: str) -> None:
        if self.top is None:
            smach.logwarn('{}: {}'.format(self.container._state_label, text))
        else:
            self.top.warn(text, '/'.join(self.below))

    def _note_outcome(self, outcome: object) -> None:
        if self._items is not None and isinstance(outcome, str):
            # one that is left for a state elsewhere, or preempted, has ended by no word of its own
            self._items.is_finished = (
                loops(self.container, outcome)
                and not is_preempted(outcome)
                and not self.container._preempt_requested
            )

    def _begin_item(self) -> None:
        machine = self.machines.get(self.container._state_label)
        node = None if machine is None else machine._oracle
        record = None if node is None else node.records.by_label.get(self.container._state_label)
        unfinished = None
        if node is not None and record is not None:
            unfinished = node.tree.resumed.unfinished(record)
        begun = None if unfinished is None else unfinished.snapshot
        self._userdata.begin_item(begun, self._deep_copy_keys(), self._warn_not_copied)

    def ended(self, outcome: object, error: Optional[BaseException]) -> None:
        """Tell that the container has ended, with an outcome or an error."""
        self._ended_with = outcome if isinstance(outcome, str) and not self._is_left else None
        if self._items is not None and self._items.is_exhausted:
            _forget_given_up(self.container)  # the author has gone on behind it
        super().ended(outcome, error)

    def _give_places_back(self) -> None:
        iterator = self.container
        if iterator._items is self._items and self._items is not None:
            iterator._items = self._items.given
        iterator._state = real(iterator._state)

    def without_places(self, attributes: Dict[str, Any]) -> Dict[str, Any]:
        """Return the attributes of its container for a copy, as they are while it is at rest."""
        items = attributes.get('_items')
        return dict(
            attributes,
            _state=real(attributes.get('_state')),
            _items=items.given if isinstance(items, TrackedItems) else items,
        )

    def __getstate__(self) -> Dict[str, Any]:
        return dict(super().__getstate__(), _items=None, _ended_with=None, _is_asked_to_go_on=False)

    # -- userdata

    def keys_to_keep(self, userdata: Optional[smach.UserData]) -> Dict[str, Any]:
        """Return the values of its keys that its inputs do not replace, as it begins or goes on.

        `userdata`: what the inputs are copied from.
        """
        deep = self._deep_copy_keys()
        if not self.goes_on:
            self._userdata.begin(userdata, deep, self._warn_not_copied)
            return {}
        if (
            self._items is not None
            and not self._items.is_finished
            and self.top is not None
            and self.top.settings.userdata == 'restore'
        ):
            self._userdata.take_back(deep)
        return self._userdata.to_keep(userdata)

    def _warn_not_copied(self, key: str, why: str) -> None:
        if self.top is not None:
            self.top.warn_not_copied(key, why)

    def _deep_copy_keys(self) -> Sequence[str]:
        return self.top.in_force.deep_copy_keys if self.top is not None else ()


def border_of(state: object) -> Optional[Border]:
    """Return what is kept beside a Concurrence or an Iterator, or None for anything else."""
    border = own_mark(state, BORDER)
    return border if isinstance(border, Border) else None


def _children_of(container: Any) -> Mapping[str, Any]:
    if isinstance(container, smach.StateMachine):
        return container._states
    children: Mapping[str, Any] = container.get_children()
    return children


def _forget_given_up(container: smach.Container) -> None:
    """Forget whether the oracles of the machines in a container have given up."""
    for _, machine in machines_below(container):
        node = node_of(machine)
        if node is not None:
            node.execution.forget_unrecovered()


def _forget(outcome: object) -> None:
    """Nobody needs to know with what a branch has ended."""
