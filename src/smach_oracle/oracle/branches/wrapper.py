"""Concurrences and Iterators of a wrapped tree: what is kept for one, and its hook."""

import contextlib
import threading
from typing import Callable, Dict, Iterator, List, Mapping, Optional, Protocol, Tuple, cast

import smach

from ..machine import nesting
from ..machine.execution import why_no_outcome
from ..machine.items import TrackedItems
from ..machine.nesting import branching_below, nodes_in, nodes_of
from ..machine.places import links_to
from ..machine.tree_node import TreeNode
from ..records.events import EventKind
from ..records.facts import BRANCHES
from ..recovery.stack_room import too_deep_below, too_deep_here
from ..smach_private import Labels, data_of, is_executing, mark_on, states_of
from .branch import Branch


class StoredPort(Protocol):
    """The part of a stored container that a Concurrence or an Iterator goes on from."""

    item: int  # number of the one to begin with, from 1. 0 means the first

    def put_into(self, data: Dict[str, object]) -> None:
        """Have userdata as they were."""


class WrappedExecution:
    """One execution of a Concurrence or an Iterator. `outcome`: with which it has ended.

    `is_entered`: its branches have their oracles. Else it runs bare.
    """

    outcome: Optional[str] = None
    is_entered: bool


class ContainerWrapper:
    """The data kept for a Concurrence of a wrapped tree, or for an Iterator (`IteratorWrapper`).

    It is the `smach.hooks.ExecutionHook` of the container. `branches`: those of its states that
    have oracles of their own, by label. `runners`: the same while the container executes, once at a
    time. They execute in the place of the states then.
    """

    tracked: Optional[TrackedItems] = None  # of an Iterator

    def __init__(self, container: smach.Container, parent: TreeNode, labels: Labels) -> None:
        """`parent`: the node of the wrapped machine around it. `labels`: from there."""
        self.container = container
        self.parent = parent
        self.labels_from_parent = labels
        self.branches: Dict[str, Branch] = {}
        self.runners: Dict[str, Branch] = {}
        self._lock = threading.Lock()
        self._is_in_use = False
        self._resumed: Optional[Tuple[StoredPort, str]] = None  # with the id of its trial

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

    @contextlib.contextmanager
    def execution(self, container: smach.Container) -> Iterator[WrappedExecution]:
        """Return the context in which the container executes, its branches under their oracles."""
        execution = WrappedExecution()
        execution.is_entered = container is self.container and self._enter()
        if not execution.is_entered:
            yield execution
            return
        error: Optional[BaseException] = None
        try:
            yield execution
        except BaseException as err:
            error = err
            self._explain(err)
            raise
        finally:
            self._leave(execution.outcome, error)

    def take_inputs(
        self,
        container: smach.Container,
        copy: Callable[[], None],
        parent_ud: Optional[smach.UserData],
    ) -> None:
        """Take the inputs, by `copy()`, and the userdata that `resume` was given."""
        copy()
        if container is not self.container:
            return
        stored, self._resumed = self._to_resume(), None
        if stored is not None:
            stored.put_into(data_of(container.userdata))

    def runner_of(self, container: smach.Container, label: str, state: smach.State) -> smach.State:
        """Return what executes a state.

        A state that has been added since is executed as it is, and so is one of a shallow copy.
        """
        runner = self.runners.get(label) if container is self.container else None
        return runner if runner is not None and runner.state is state else state

    def _enter(self) -> bool:
        """Begin an execution. Return False where that cannot be, so that it runs bare."""
        with self._lock:
            runs = is_executing(self.parent.machine) or self.parent.has_running_ancestor()
            if self._is_in_use or not runs:
                return False
            self._is_in_use = True
        states = dict(self.states())
        for label, branch in self.branches.items():
            branch.take(self.container, states[label])
        nodes = self.nodes()
        for node in nodes:
            node.begin_once_more()
        if nodes:
            labels = list(self.branches)
            nodes[0].emit(EventKind.CONTAINER_START, ', '.join(labels), data={BRANCHES: labels})
        self._begin()
        self.runners = dict(self.branches)
        return True

    def _begin(self) -> None:
        for branch in self.branches.values():
            branch.begin(None)

    def _leave(self, outcome: object, error: Optional[BaseException]) -> None:
        """Tell that the container has ended, and let its states execute by themselves again.

        `outcome`: that of a user's own class may be anything.
        """
        nodes = self.nodes()
        if nodes:
            told = outcome if isinstance(outcome, str) else ''
            nodes[0].emit(
                EventKind.CONTAINER_END, outcome=told, text=why_no_outcome(outcome, error)
            )
        for runner in self.runners.values():
            runner.end()
        self.runners = {}
        with self._lock:
            self._is_in_use = False

    # -- going on after the program was stopped

    def resume(self, stored: StoredPort) -> None:
        """Go on from there at the next execution of this trial, once its inputs are copied."""
        self._resumed = stored, self.parent.tree.trial_id

    def forget_resumed(self) -> None:
        """Begin the next execution from the start, whatever was under way in the program before."""
        self._resumed = None

    @property
    def is_resumed(self) -> bool:
        """Whether its next execution goes on where the program was stopped."""
        return self._to_resume() is not None

    def _to_resume(self) -> Optional[StoredPort]:
        """Return how it goes on, unless that was of a trial before."""
        if self._resumed is None or self._resumed[1] != self.parent.tree.trial_id:
            return None
        return self._resumed[0]

    def _explain(self, error: BaseException) -> None:
        """Have an error of the container say that a branch has ended the program by it.

        :raises TooDeepError: in its place, where too many containers lie in each other.
        """
        if isinstance(error, smach.InvalidStateError):
            error.__cause__ = error.__cause__ or self.parent.tree.early_end.of_program
        if too_deep_below(error) is None:
            top = self.parent.top()
            too_deep = too_deep_here(top.machine, top.path, error)
            if too_deep is not None:
                raise too_deep from None

    def states(self) -> Iterator[Tuple[str, smach.State]]:
        """Yield the user's states by label."""
        children: Mapping[str, Optional[smach.State]] = self.container.get_children()
        yield from ((label, state) for label, state in dict(children).items() if state is not None)

    def __getstate__(self) -> Dict[str, object]:
        state = dict(self.__dict__, _is_in_use=False, runners={})
        del state['_lock']
        return state

    def __setstate__(self, state: Dict[str, object]) -> None:
        self.__dict__.update(state)
        self._lock = threading.Lock()


def wrapper_of(state: object) -> Optional[ContainerWrapper]:
    """Return what is kept beside a Concurrence or an Iterator, or None for anything else."""
    return cast('Optional[ContainerWrapper]', nesting.wrapper_of(state))


def wrappers_around(node: TreeNode) -> List[Tuple[str, ContainerWrapper]]:
    """Return them, each with its path, the outermost first."""
    if not node.runs_in_branch:
        return []
    path, found = cast('TreeNode', node.parent).key, []
    for link in links_to(node):
        path = '/'.join((path, link.label))
        wrapper = wrapper_of(link.inner_container)
        if wrapper is not None:  # the last label of a nested machine is its own
            found.append((path, wrapper))
    return found


def wrappers_in(node: TreeNode, label: str) -> List[Tuple[str, ContainerWrapper]]:
    """Return those in a state of a machine, down to the next machines, each with its path."""
    return [
        ('/'.join((node.key,) + below), wrapper)
        for below, wrapper in (
            (below, wrapper_of(container)) for below, container in branching_below(node.machine)
        )
        if wrapper is not None and below[0] == label
    ]


def goes_on_inside(node: TreeNode, label: str) -> bool:
    """Whether a container in a state goes on where it stood when the program was stopped."""
    if not node.tree.is_resumed:
        return False
    outermost = nodes_in(states_of(node.machine)[label]) if node.has(label) else []
    below = (each for outer in outermost for each in nodes_of(outer.machine))
    return any(node.tree.resumed.goes_on(each.records) for each in below) or any(
        wrapper.is_resumed for _, wrapper in wrappers_in(node, label)
    )
