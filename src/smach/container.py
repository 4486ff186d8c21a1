"""The base of the four kinds of container: construction in ``with`` blocks, callbacks, userdata at
the border.

Containers are states, so they nest. While a container is open, ``StateMachine.add(...)`` and its
like add to it.
"""

import contextlib
import threading
import time
import traceback
from typing import Any, Callable, Dict, Iterator, List, Optional, Sequence, Tuple

import smach
from smach.state import State

__all__ = ['Container']

Callback = Tuple[Callable[..., object], Sequence[Any]]
Edge = Tuple[str, str, Optional[str]]

# How often a paused container looks whether it was resumed, preempted or shut down.
_PAUSE_POLL_S = 0.02


class Container(State):
    """Base class of StateMachine, Concurrence and Iterator (and Sequence, which is a
    StateMachine).
    """

    # All open containers of the process, the innermost last. One thread builds at a time.
    _construction_stack: List['Container'] = []
    _construction_lock = threading.RLock()

    # an ``ExecutionHook`` (``smach.hooks``) of a Concurrence or an Iterator, or one that is like it
    execution_hook: Any = None

    _context_kwargs: Sequence[Any] = ()
    _pause_requested = False  # of containers that do not call __init__

    def __init__(
        self,
        outcomes: Sequence[str] = (),
        input_keys: Sequence[str] = (),
        output_keys: Sequence[str] = (),
    ) -> None:
        State.__init__(self, outcomes, input_keys, output_keys)
        self.userdata = smach.UserData()
        self._pause_requested = False
        self._start_cbs: List[Callback] = []
        self._transition_cbs: List[Callback] = []
        self._termination_cbs: List[Callback] = []

    # -- construction

    @staticmethod
    def _any_containers_opened() -> bool:
        return bool(Container._construction_stack)

    @classmethod
    def _currently_opened_container(cls) -> Any:
        """The innermost open container. InvalidStateError if there is none, or none of this
        class.
        """
        if not Container._construction_stack:
            raise smach.InvalidStateError(
                'No container is open; states are added inside `with container:`.'
            )
        innermost = Container._construction_stack[-1]
        if not isinstance(innermost, cls):
            raise smach.InvalidStateError(
                'The innermost open container is %r, which is no %s.' % (innermost, cls.__name__)
            )
        return innermost

    def open(self) -> None:
        """Let construction methods called from now on add to this container."""
        Container._construction_lock.acquire()
        Container._construction_stack.append(self)

    def close(self) -> None:
        """End what open() began. An inconsistency is logged here, long before the container
        runs.
        """
        self._pop_construction_stack()
        self._is_consistent()

    def _pop_construction_stack(self) -> None:
        stack = Container._construction_stack
        if not stack or stack[-1] is not self:
            raise smach.InvalidStateError(
                'This container is not open, so there is nothing to close.'
            )
        stack.pop()
        Container._construction_lock.release()

    def is_opened(self) -> bool:
        """Whether this is the innermost open container: the one construction methods add to."""
        stack = Container._construction_stack
        return bool(stack) and stack[-1] is self

    def assert_opened(self, msg: str = '') -> None:
        """Raise InvalidConstructionError(msg) if this is not the innermost open container."""
        if not self.is_opened():
            raise smach.InvalidConstructionError(msg)

    @contextlib.contextmanager
    def opened(self, **kwargs: Any) -> Iterator['Container']:
        """``with container.opened(...)``: open for the block, with arguments for subclasses in
        _context_kwargs.
        """
        self._context_kwargs = kwargs  # type: ignore[assignment]
        with self:
            yield self

    def __enter__(self) -> Any:
        self.open()
        return self

    def __exit__(self, exc_type: Any, exc_val: Any, exc_tb: Any) -> None:
        if exc_type is None:
            self.close()
            return
        self._pop_construction_stack()
        if issubclass(exc_type, (smach.InvalidStateError, smach.InvalidTransitionError)):
            return  # logged already, where it was raised
        smach.logerr(
            'An exception left the construction of a container: \n%s'
            % ''.join(traceback.format_exception(exc_type, exc_val, exc_tb))
        )

    def check_consistency(self) -> None:
        """Raise InvalidStateError or InvalidTransitionError if the container cannot run,
        overridden.
        """
        raise NotImplementedError

    def _is_consistent(self) -> bool:
        try:
            self.check_consistency()
        except (smach.InvalidStateError, smach.InvalidTransitionError):
            smach.logerr('The container is inconsistent.')
            return False
        return True

    # -- what outsiders may ask, overridden by each kind

    def __getitem__(self, key: str) -> State:
        raise NotImplementedError

    def get_children(self) -> Dict[str, State]:
        """Return the states of this container by label."""
        raise NotImplementedError

    def get_initial_states(self) -> List[str]:
        """Return the labels at which execution begins."""
        raise NotImplementedError

    def set_initial_state(self, initial_states: List[str], userdata: Any) -> None:
        """Begin at these labels from now on, with the keys of ``userdata`` added to the
        container's.
        """
        raise NotImplementedError

    def get_active_states(self) -> List[str]:
        """Return the labels of the states that are being executed."""
        raise NotImplementedError

    def get_internal_edges(self) -> List[Edge]:
        """Return all transitions, as (outcome, from label, to label or container outcome)."""
        raise NotImplementedError

    # -- callbacks

    def register_start_cb(
        self, start_cb: Callable[..., object], cb_args: Sequence[Any] = ()
    ) -> None:
        """Call ``start_cb(userdata, initial_states, *cb_args)`` when the container starts."""
        self._start_cbs.append((start_cb, cb_args))

    def register_transition_cb(
        self, transition_cb: Callable[..., object], cb_args: Sequence[Any] = ()
    ) -> None:
        """Call ``transition_cb(userdata, active_states, *cb_args)`` after each transition."""
        self._transition_cbs.append((transition_cb, cb_args))

    def register_termination_cb(
        self, termination_cb: Callable[..., object], cb_args: Sequence[Any] = ()
    ) -> None:
        """Call ``termination_cb(userdata, terminal_states, outcome, *cb_args)`` when the container
        ends.
        """
        self._termination_cbs.append((termination_cb, cb_args))

    def call_start_cbs(self) -> None:
        """Call the start callbacks. What they raise is logged."""
        if self._start_cbs:
            self._call_all('start', self._start_cbs, self.get_initial_states())

    def call_transition_cbs(self) -> None:
        """Call the transition callbacks. What they raise is logged."""
        if self._transition_cbs:
            self._call_all('transition', self._transition_cbs, self.get_active_states())

    def call_termination_cbs(self, terminal_states: Any, outcome: str) -> None:
        """Call the termination callbacks. What they raise is logged."""
        if self._termination_cbs:
            self._call_all('termination', self._termination_cbs, terminal_states, outcome)

    def _call_all(self, kind: str, callbacks: List[Callback], *first_args: Any) -> None:
        """Call each callback in turn. As soon as one raises, the rest of this round is left out."""
        try:
            for callback, args in callbacks:
                callback(self.userdata, *first_args, *args)
        except Exception:
            smach.logerr('Could not execute %s callback: %s' % (kind, traceback.format_exc()))

    # -- userdata at the border

    def _copy_input_keys(self, parent_ud: Any, ud: Any) -> None:
        """Copy this container's input keys from the parent's userdata. A missing one is a
        warning.
        """
        if parent_ud is not None:
            _copy_keys(self.get_registered_input_keys(), parent_ud, ud, 'input')

    def _execution(self) -> Any:
        """The context of one execution, which the hook may give."""
        hook = self.execution_hook
        return _NO_HOOK if hook is None else hook.execution(self)

    def _take_inputs(self, parent_ud: Any) -> None:
        hook = self.execution_hook
        if hook is None:
            self._copy_input_keys(parent_ud, self.userdata)
        else:
            hook.take_inputs(
                self, lambda: self._copy_input_keys(parent_ud, self.userdata), parent_ud
            )

    def _runner(self, label: str, state: Any) -> Any:
        """Return what executes a state: the state itself, or whatever the hook names."""
        hook = self.execution_hook
        return state if hook is None else hook.runner_of(self, label, state)

    def _take_back_preempt(self, label: str, state: Any) -> bool:
        """Take back a request that a state, or its runner, has not serviced. Whether there was
        one.
        """
        runner = self._runner(label, state)
        asked = runner.preempt_requested() or (runner is not state and state.preempt_requested())
        if asked:
            runner.recall_preempt()  # which takes that of its state back, too
        return bool(asked)

    def _copy_output_keys(self, ud: Any, parent_ud: Any) -> None:
        """Copy this container's output keys to the parent's userdata. A missing one is a
        warning.
        """
        if parent_ud is not None:
            _copy_keys(self.get_registered_output_keys(), ud, parent_ud, 'output')

    # -- pause

    def request_pause(self) -> None:
        """Hold before the next state is entered, here and in running containers inside, until
        request_resume().

        The states that are being executed go on to their end. A preempt or a shutdown ends the
        pause.
        """
        self._pause_requested = True
        for child in self._active_children():
            if isinstance(child, Container):
                child.request_pause()

    def request_resume(self) -> None:
        """Go on after request_pause()."""
        self._pause_requested = False
        for child in self.get_children().values():
            if isinstance(child, Container):
                child.request_resume()

    def pause_requested(self) -> bool:
        """Whether request_pause() was called and not yet taken back by request_resume()."""
        return self._pause_requested

    def _active_children(self) -> List[State]:
        children = self.get_children()
        return [children[label] for label in self.get_active_states() if label in children]

    def _wait_while_paused(self) -> None:
        """Return once resumed, preempted or shut down, at once if not paused."""
        if not self._pause_requested:
            return
        smach.loginfo('%s paused before executing the next state.' % type(self).__name__)
        while self._pause_requested and not self.preempt_requested() and not smach.is_shutdown():
            time.sleep(_PAUSE_POLL_S)
        self._pause_requested = False
        smach.loginfo('%s resumed.' % type(self).__name__)


class _NoHook(object):
    """The context of an execution without a hook."""

    __slots__ = ('outcome',)

    def __enter__(self) -> '_NoHook':
        return self

    def __exit__(self, *raised: Any) -> None:
        pass


_NO_HOOK = _NoHook()


def _copy_keys(keys: Sequence[str], source: Any, target: Any, kind: str) -> None:
    for key in keys:
        try:
            target[key] = source[key]
        except KeyError:
            smach.logwarn(
                "The container's %s key '%s' has no value; it is not copied." % (kind, key)
            )
