"""Concurrences and Iterators of a wrapped tree: what is kept for one, and its hook."""

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
    Tuple,
    Type,
)

import smach

from ..machine import nesting
from ..machine.execution import why_no_outcome
from ..machine.tree_node import TreeNode
from ..records.events import EventKind
from ..records.facts import BRANCHES
from ..recovery.stack_room import too_deep_below, too_deep_here
from ..smach_private import Labels, data_of, is_executing, mark_on
from .branch import Branch
from .items import TrackedItems


class _ResumedItem(NamedTuple):
    """The values with which a container that was under way goes on. See `resume`."""

    keys: Dict[str, Any]
    gone: Tuple[str, ...]
    item: int
    tell: Callable[[Mapping[str, Any]], None]
    trial_id: str


class ContainerWrapper:
    """The data kept for a Concurrence of a wrapped tree, or for an Iterator (`IteratorWrapper`).

    It is the `smach.hooks.ExecutionHook` of the container. `branches`: those of its states that
    have oracles of their own, by label. `runners`: the same while the container executes, once at a
    time. They execute in the place of the states then.
    """

    tracked: Optional[TrackedItems] = None  # of an Iterator

    def __init__(self, container: smach.Container, top: TreeNode, below: Labels) -> None:
        """`top`: the node of the wrapped machine around it. `below`: the labels from there."""
        self.container = container
        self.top = top
        self.below = below
        self.branches: Dict[str, Branch] = {}
        self.runners: Dict[str, Branch] = {}
        self._lock = threading.Lock()
        self._is_in_use = False
        self._resumed: Optional[_ResumedItem] = None

    def in_words(self) -> str:
        """Return which item is under way, such as 'item 2 of 4', or '' where none is."""
        return self.tracked.in_words() if self._is_in_use and self.tracked is not None else ''

    @property
    def item_number(self) -> int:
        """Return the number of the item under way, from 1. 0 means none is."""
        return self.tracked.number if self._is_in_use and self.tracked is not None else 0

    def nodes(self) -> List[TreeNode]:
        """Return the nodes of its branches."""
        return [mark_on(branch) for branch in self.branches.values()]

    # -- the hook

    def execution(self, container: smach.Container) -> 'WrappedExecution':
        """Return the context in which the container executes, its branches under their oracles."""
        return WrappedExecution(self, container)

    def take_inputs(
        self,
        container: smach.Container,
        copy: Callable[[], None],
        parent_ud: Optional[smach.UserData],
    ) -> None:
        """Take the inputs, by `copy()`, and the userdata that `resume` was given."""
        copy()
        if container is self.container:
            self._take_over_userdata()

    def runner_of(self, container: smach.Container, label: str, state: smach.State) -> smach.State:
        """Return what executes a state.

        A state that has been added since is executed as it is, and so is one of a shallow copy.
        """
        runner = self.runners.get(label) if container is self.container else None
        return runner if runner is not None and runner.is_of(state) else state

    def enter(self) -> bool:
        """Begin an execution. Return False where that cannot be, so that it runs bare."""
        with self._lock:
            if self._is_in_use or not self._runs_in_tree():
                return False
            self._is_in_use = True
        states = dict(self.states())
        for label, branch in self.branches.items():
            branch.take(self.container, states[label])
        nodes = self.nodes()
        for node in nodes:
            node.begin_once_more()
        if nodes:
            nodes[0].emit(
                EventKind.CONTAINER_START,
                state=', '.join(self.branches),
                data={BRANCHES: list(self.branches)},
            )
        self._begin()
        self.runners = dict(self.branches)
        return True

    def _begin(self) -> None:
        for branch in self.branches.values():
            branch.begin(None)

    def leave(self, outcome: Optional[str], error: Optional[BaseException]) -> None:
        """Tell that the container has ended, and let its states execute by themselves again."""
        nodes = self.nodes()
        if nodes:
            nodes[0].emit(
                EventKind.CONTAINER_END,
                text=why_no_outcome(outcome, error),
                outcome=outcome or '',
            )
        for runner in self.runners.values():
            runner.end()
        self.runners = {}
        with self._lock:
            self._is_in_use = False

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
            data = data_of(self.container.userdata)
            for key in resumed.gone:
                data.pop(key, None)
            data.update(resumed.keys)
            resumed.tell(data)

    def _trial_now(self) -> str:
        return self.top.tree.trial_id

    def _runs_in_tree(self) -> bool:
        return is_executing(self.top.machine) or self.top.has_running_ancestor()

    def explain(self, error: BaseException) -> None:
        """Have an error of the container say that a branch has ended the program by it.

        :raises TooDeepError: in its place, where too many containers lie in each other.
        """
        if isinstance(error, smach.InvalidStateError):
            error.__cause__ = error.__cause__ or self.top.tree.early_end.of_program
        too_deep = too_deep_here(self.top, error) if too_deep_below(error) is None else None
        if too_deep is not None:
            raise too_deep from None

    def states(self) -> Iterator[Tuple[str, smach.State]]:
        """Yield the user's states by label."""
        children: Mapping[str, Optional[smach.State]] = self.container.get_children()
        yield from ((label, state) for label, state in list(children.items()) if state is not None)

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
            self._wrapper.leave(self.outcome, error)


def wrapper_of(state: object) -> Optional[ContainerWrapper]:
    """Return what is kept beside a Concurrence or an Iterator, or None for anything else."""
    wrapper = nesting.wrapper_of(state)
    return wrapper if isinstance(wrapper, ContainerWrapper) else None
