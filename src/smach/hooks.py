"""What somebody may put in the way of a container's execution: a hook, or methods of their own."""

from typing import Any, Callable, Dict, Iterable, Optional, Union

from smach.container import Container
from smach.state import State

_HOOKS = {
    'preempt_requested': State.preempt_requested,
    'call_transition_cbs': Container.call_transition_cbs,
}


def is_hooked(machine: Any) -> bool:
    """Whether one of them was overridden or patched."""
    return any(
        getattr(getattr(machine, name), '__func__', None) is not method
        for name, method in _HOOKS.items()
    )


class HookedExecution(object):
    """The context of one execution. ``outcome``: with which that ends, None where it raises.

    It keeps no frame on the stack, on which containers may lie in each other many times.
    """

    outcome: Optional[str] = None

    def __enter__(self) -> 'HookedExecution':
        return self

    def __exit__(self, kind: Any, error: Optional[BaseException], trace: Any) -> None:
        pass


class ExecutionHook(object):
    """Has a say in the execution of a Concurrence or an Iterator whose ``execution_hook`` it is.

    This one changes nothing. A container may have one hook, which is set while it is at rest.

    ``runners``: by label, what executes a state in its place. It needs the methods ``execute(ud)``,
    ``request_preempt()``, ``preempt_requested()`` and ``recall_preempt()`` of a state. The last one
    takes back what its state was asked, too. Whoever asks the container for its children gets the
    states.
    """

    def __init__(self) -> None:
        self.runners: Dict[str, Any] = {}

    def runner_of(self, container: Any, label: str, state: Any) -> Any:
        """Return what executes a state of the container, the state itself where nothing does.

        It is asked as the container begins, and again if the state at a label is another by then.
        """
        return self.runners.get(label, state)

    def execution(self, container: Any) -> 'HookedExecution':
        """Return the context in which the container executes once.

        A shallow copy of a container has its hook too, hence ``container``.
        """
        return HookedExecution()

    def take_inputs(self, container: Any, copy: Callable[[], None], parent_ud: Any) -> None:
        """Let the container take its input keys, by ``copy()``."""
        copy()

    def items(
        self, container: Any, items: Union[Iterable[Any], Callable[[], Iterable[Any]]]
    ) -> Union[Iterable[Any], Callable[[], Iterable[Any]]]:
        """Return what an Iterator goes through in place of its items."""
        return items
