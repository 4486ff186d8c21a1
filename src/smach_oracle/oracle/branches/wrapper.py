"""Concurrences and Iterators of a wrapped tree: their branches, and where an Iterator goes on."""

import threading
from types import TracebackType
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
    Type,
    Union,
    cast,
)

import smach

from ..machine import nesting
from ..machine.execution import why_no_outcome
from ..machine.nesting import machines_below
from ..machine.tree_node import TreeNode, marked_node, node_of
from ..records.events import EventKind
from ..records.facts import BRANCHES
from ..recovery.failure import Failure, judge
from ..recovery.stack_room import too_deep_below, too_deep_here
from ..settings.failing_outcomes import is_preempted
from .branch import loops
from .branch_machine import BranchMachine
from .item_userdata import ItemUserdata
from .items import TrackedItems
from .runner import BranchRunner, ItemRunner, Runner


class _ResumedItem(NamedTuple):
    """The values with which a container that was under way goes on. See `resume`."""

    keys: Dict[str, Any]
    gone: Tuple[str, ...]
    item: int
    tell: Callable[[Mapping[str, Any]], None]
    trial_id: str


class ContainerWrapper:
    """The data kept for a Concurrence or an Iterator of a wrapped tree.

    It is the `smach.hooks.ExecutionHook` of the container. `machines`: the hidden machines of its
    branches, by label. `runners`: what executes its states in their place, by label, while the
    container executes, once at a time.
    """

    def __init__(self, container: smach.Container) -> None:
        self.container: Any = container
        self.machines: Dict[str, smach.StateMachine] = {}
        self.runners: Dict[str, Runner] = {}
        self.top: Optional[TreeNode] = None  # the node of the wrapped machine around it
        self.below: Tuple[str, ...] = ()  # labels that lead to it from there
        self._lock = threading.Lock()
        self._is_in_use = False
        self._resumed: Optional[_ResumedItem] = None

    def in_words(self) -> str:
        """Return which item is under way, such as 'item 2 of 4', or '' where none is."""
        return ''

    @property
    def item_number(self) -> int:
        """Return the number of the item under way, from 1. 0 means none is."""
        return 0

    def ask_to_go_on(self, go_on: bool) -> None:
        """Let the next execution of an Iterator go on where the one before has stopped."""

    def has_stopped_early(self, node: TreeNode, label: str) -> bool:
        """Whether an Iterator has failed or was left, when it was executed last.

        `node`, `label`: where it is a state.
        """
        return False

    def note_left(self) -> None:
        """Note that it is left for a state elsewhere."""

    def nodes(self) -> List[TreeNode]:
        """Return the nodes of its branches."""
        return [marked_node(machine) for machine in self.machines.values()]

    # -- the hook

    def execution(self, container: smach.Container) -> 'WrappedExecution':
        """Return the context in which the container executes, its branches under their oracles."""
        return WrappedExecution(self, container)

    def take_inputs(
        self, container: smach.Container, copy: Callable[[], None], parent_ud: Any
    ) -> None:
        """Take the inputs, by `copy()`, and the userdata that `resume` was given."""
        copy()
        if container is self.container:
            self._take_over_userdata()

    def items(self, container: smach.Container, items: Any) -> Any:
        """Return what an Iterator goes through in place of its items."""
        return items

    def runner_of(
        self, container: smach.Container, label: str, state: smach.State
    ) -> Union[Runner, smach.State]:
        """Return what executes a state.

        A state that has been added since is executed as it is, and so is one of a shallow copy.
        """
        runner = self.runners.get(label) if container is self.container else None
        return runner if runner is not None and runner.is_of(state) else state

    def enter(self) -> bool:
        """Make the runners. Return False where that cannot be, so that it runs bare."""
        with self._lock:
            nodes = self.nodes()
            if self._is_in_use or not self._runs_in_tree():
                return False
            self._is_in_use = True
        states = dict(self.states())
        for machine in self.machines.values():
            self._renew(machine, states)
            marked_node(machine).begin_execution()
        if nodes:
            nodes[0].emit(
                EventKind.CONTAINER_START,
                state=', '.join(self.machines),
                data={BRANCHES: list(self.machines)},
            )
        self.runners = self._make_runners(states)
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

    def _take_over_userdata(self) -> None:
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

    def _renew(self, machine: smach.StateMachine, states: Mapping[str, smach.State]) -> None:
        branch = cast(BranchMachine, machine)
        label = branch._branch_label
        branch.take(states[label], self.container.userdata, self._remapping_of(label))

    def explain(self, error: BaseException) -> None:
        """Have an error of the container say that a branch has ended the program by it.

        :raises TooDeepError: in its place, where too many containers lie in each other.
        """
        if self.top is None:
            return
        if isinstance(error, smach.InvalidStateError):
            error.__cause__ = error.__cause__ or self.top.tree.early_end.of_program
        too_deep = too_deep_here(self.top, error) if too_deep_below(error) is None else None
        if too_deep is not None:
            raise too_deep from None

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
        """Let the states execute by themselves again."""
        for runner in self.runners.values():
            runner.retire()
        self.runners = {}
        with self._lock:
            self._is_in_use = False

    def states(self) -> Iterator[Tuple[str, smach.State]]:
        """Yield the user's states by label."""
        children: Mapping[str, Optional[smach.State]] = self.container.get_children()
        yield from ((label, state) for label, state in list(children.items()) if state is not None)

    def _remapping_of(self, label: str) -> Mapping[str, str]:
        raise NotImplementedError

    def _make_runners(self, states: Mapping[str, smach.State]) -> Dict[str, Runner]:
        raise NotImplementedError

    def __getstate__(self) -> Dict[str, Any]:
        state = dict(self.__dict__, _is_in_use=False, runners={})
        del state['_lock']
        return state

    def __setstate__(self, state: Dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._lock = threading.Lock()


class WrappedExecution:
    """One execution of a Concurrence or an Iterator. `outcome`: with which it has ended.

    It runs bare where its branches cannot have their oracles.
    """

    outcome: Optional[str] = None

    def __init__(self, wrapper: ContainerWrapper, container: smach.Container) -> None:
        self._wrapper = wrapper
        self._container = container
        self.is_entered = False

    def __enter__(self) -> 'WrappedExecution':
        wrapper = self._wrapper
        self.is_entered = wrapper.container is self._container and wrapper.enter()
        return self

    def __exit__(
        self,
        kind: Optional[Type[BaseException]],
        error: Optional[BaseException],
        trace: Optional[TracebackType],
    ) -> None:
        if not self.is_entered:
            return
        try:
            if error is not None:
                self._wrapper.explain(error)
        finally:
            self._wrapper.ended(self.outcome, error)
            self._wrapper.leave()


class ConcurrenceWrapper(ContainerWrapper):
    """The data kept for a Concurrence."""

    def _remapping_of(self, label: str) -> Mapping[str, str]:
        return self.container._remappings[label]

    def _make_runners(self, states: Mapping[str, smach.State]) -> Dict[str, Runner]:
        return {
            label: BranchRunner(states[label], machine) for label, machine in self.machines.items()
        }


class IteratorWrapper(ContainerWrapper):
    """The data kept for an Iterator."""

    def __init__(self, container: smach.Container) -> None:
        super().__init__(container)
        self.tracked: Optional[TrackedItems] = None
        self._trial_id = ''  # that of `tracked`
        self._rounds = 0  # how often it has begun again
        self._inside: Tuple[Tuple[int, int], ...] = ()  # marks of the Iterators around it then
        self.item_userdata = ItemUserdata(container)
        self._ended_with: Optional[str] = None  # None: an error, or it was left
        self._is_left = False
        self._is_asked_to_go_on = False
        self.goes_on = False

    def in_words(self) -> str:
        """Return which item is under way, such as 'item 2 of 4', or '' where none is."""
        return self.tracked.in_words() if self._is_in_use and self.tracked is not None else ''

    @property
    def item_number(self) -> int:
        """Return the number of the item under way, from 1. 0 means none is."""
        return self.tracked.number if self._is_in_use and self.tracked is not None else 0

    # -- going on

    def ask_to_go_on(self, go_on: bool) -> None:
        """Let the next execution go on where the one before has stopped, or begin again."""
        self._is_asked_to_go_on = go_on

    def has_stopped_early(self, node: TreeNode, label: str) -> bool:
        """Whether it has failed or was left, when it was executed last."""
        outcome = self._ended_with
        return (
            outcome is None
            or is_preempted(outcome)
            or isinstance(judge(node, node.record(label), outcome, None), Failure)
        )

    def note_left(self) -> None:
        """Note that it is left for a state elsewhere: the outcome it gets is no word of its own."""
        self._is_left = True

    def _remapping_of(self, label: str) -> Mapping[str, str]:
        return {}

    def items(self, container: smach.Container, items: Any) -> Any:
        """Return what the Iterator goes through in place of its items."""
        is_own = container is self.container and self._is_in_use
        return self.tracked if is_own and self.tracked is not None else items

    def _make_runners(self, states: Mapping[str, smach.State]) -> Dict[str, Runner]:
        self._begin()
        runners: Dict[str, Runner] = {}
        for label, state in states.items():
            machine = self.machines.get(label)
            if machine is None:
                runners[label] = ItemRunner(state, self)
            else:
                runners[label] = BranchRunner(state, machine, self)
        return runners

    def _begin(self) -> None:
        """Find out where it begins, and whether it goes on."""
        items, trial_id = self.tracked, self._trial_now()
        inside = tuple(wrapper.mark() for wrapper in self._iterators_around())
        if items is None or items.given is not self.container._items:
            items = TrackedItems(self.container._items, self._tell)
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
        self.tracked, self._trial_id, self._ended_with = items, trial_id, None
        self._is_left = False
        self._inside = inside

    def mark(self) -> Tuple[int, int]:
        """Return what is different for each item: its number, and that of the round."""
        return self._rounds, self.tracked.number if self.tracked is not None else 0

    def _iterators_around(self) -> Iterator['IteratorWrapper']:
        node: Optional[TreeNode] = self.top
        below: Tuple[str, ...] = self.below
        while node is not None:
            container: Any = node.machine
            for label in below[:-1]:
                container = _children_of(container)[label]
                wrapper = wrapper_of(container)
                if isinstance(wrapper, IteratorWrapper):
                    yield wrapper
            below = node.below
            node = node.parent

    def _pass_on(self, states: Mapping[str, smach.State]) -> None:
        """Let an Iterator directly inside go on too: its items belong to the unfinished one."""
        for state in states.values():
            inner = wrapper_of(state)
            if isinstance(inner, IteratorWrapper) and self.tracked is not None:
                inner.ask_to_go_on(not self.tracked.is_finished)

    def _tell(self, text: str) -> None:
        if self.top is None:
            smach.logwarn('{}: {}'.format(self.container._state_label, text))
        else:
            self.top.warn(text, '/'.join(self.below))

    # -- what its runner tells

    def begin_item(self) -> None:
        """Note that an item begins."""
        label = self.container._state_label
        machine = self.machines.get(label)
        node = None if machine is None else marked_node(machine)
        record = None if node is None else node.records.by_label.get(label)
        unfinished = None
        if node is not None and record is not None:
            unfinished = node.tree.resumed.unfinished(record)
        begun = None if unfinished is None else unfinished.snapshot
        self.item_userdata.begin_item(begun, self._deep_copy_keys(), self._warn_not_copied)

    def end_item(self, outcome: object) -> None:
        """Note with which outcome of its state an item ends."""
        if self.tracked is not None and isinstance(outcome, str):
            self.tracked.is_finished = (
                self.finishes(outcome) and not self.container._preempt_requested
            )

    def finishes(self, outcome: str) -> bool:
        """Whether an item is finished by an outcome of its state.

        One that is left for a state elsewhere, or preempted, has ended by no word of its own.
        """
        return loops(self.container, outcome) and not is_preempted(outcome)

    def ended(self, outcome: object, error: Optional[BaseException]) -> None:
        """Tell that the container has ended, with an outcome or an error."""
        self._ended_with = outcome if isinstance(outcome, str) and not self._is_left else None
        if self.tracked is not None and self.tracked.is_exhausted:
            _forget_given_up(self.container)  # the author has gone on behind it
        super().ended(outcome, error)

    def __getstate__(self) -> Dict[str, Any]:
        return dict(
            super().__getstate__(), tracked=None, _ended_with=None, _is_asked_to_go_on=False
        )

    # -- userdata

    def take_inputs(
        self, container: smach.Container, copy: Callable[[], None], parent_ud: Any
    ) -> None:
        """Take the inputs, but keep what finished items have left, where it goes on."""
        kept = self._keys_to_keep(parent_ud) if container is self.container else {}
        super().take_inputs(container, copy, parent_ud)
        for key, value in kept.items():
            container.userdata[key] = value

    def _keys_to_keep(self, userdata: Optional[smach.UserData]) -> Dict[str, Any]:
        """Return the values of its keys that its inputs do not replace, as it begins or goes on.

        `userdata`: what the inputs are copied from.
        """
        deep = self._deep_copy_keys()
        if not self.goes_on:
            self.item_userdata.begin(userdata, deep, self._warn_not_copied)
            return {}
        if (
            self.tracked is not None
            and not self.tracked.is_finished
            and self.top is not None
            and self.top.settings.userdata == 'restore'
        ):
            self.item_userdata.take_back(deep)
        return self.item_userdata.to_keep(userdata)

    def _warn_not_copied(self, key: str, why: str) -> None:
        if self.top is not None:
            self.top.warn_not_copied(key, why)

    def _deep_copy_keys(self) -> Sequence[str]:
        return self.top.in_force.deep_copy_keys if self.top is not None else ()


def wrapper_of(state: object) -> Optional[ContainerWrapper]:
    """Return what is kept beside a Concurrence or an Iterator, or None for anything else."""
    wrapper = nesting.wrapper_of(state)
    return wrapper if isinstance(wrapper, ContainerWrapper) else None


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
