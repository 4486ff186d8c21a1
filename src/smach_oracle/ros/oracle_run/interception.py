"""Puts every top-level machine of a program under an oracle, without changing the program.

`execute` of smach.StateMachine and of every subclass that overrides it, present and future, first
asks whether the machine is to be wrapped. What is called is always the outermost `execute`, so that
an author's override runs once.
"""

import functools
import os
import threading
from typing import Any, Callable, Iterator, List, Optional, Tuple, Type

import smach
from smach_oracle.oracle import OracleContainer, oracle_of
from smach_oracle.oracle.identity import WeakIdentityMap, own_mark
from smach_oracle.oracle.under_way import is_under_way, seen_to_run, under_way

WrapFunction = Callable[[smach.StateMachine], None]
MARK = '_asks_for_an_oracle'


class Interception:
    """Calls `wrap(machine)` before the first execute of every top-level machine.

    Machines inside a wrapped one are its `wrap`'s business: what it leaves bare stays bare. A
    machine that a state runs inside its own `execute`, or that a Concurrence or an Iterator at the
    top contains, is a top-level one.

    :param wrap: swaps the machine's class, unless the machine cannot have an oracle. An error it
        raises surfaces from the machine's `execute`.
    :param why_left: says what to warn of where the program has wrapped a machine itself, '' for
        nothing. That is said once.
    """

    def __init__(
        self,
        wrap: WrapFunction,
        why_left: Callable[[smach.StateMachine], str] = lambda machine: '',
    ) -> None:
        self._wrap = wrap
        self._why_left: Optional[Callable[[smach.StateMachine], str]] = why_left
        self._wrapped: WeakIdentityMap[smach.StateMachine, bool] = WeakIdentityMap()
        self._process = os.getpid()  # in a child of it machines stay as they are
        self._told_in = self._process
        self._left_bare: WeakIdentityMap[smach.StateMachine, bool] = WeakIdentityMap()
        self._lock = threading.RLock()  # machines may start in several threads at once

    def install(self) -> None:
        """Intercept from now on. This cannot be taken back."""
        for cls in family(smach.StateMachine):
            self._patch(cls)
        self._patch_future_subclasses()

    def is_missed(self, machine: OracleContainer) -> bool:
        """Whether a call of the engine's `execute` has not come through that of the oracle.

        So it is where the program calls a method that it took while the machine was bare.
        """
        if not oracle_of(machine).is_top:
            return False
        if self._why_left is not None:
            self._leave(machine)
        return not is_under_way(machine)

    def before_execute(self, machine: smach.StateMachine) -> bool:
        """Wrap a bare machine where that is due, and return whether it is wrapped now."""
        if os.getpid() != self._process:
            if self._told_in != os.getpid():
                self._told_in = os.getpid()
                smach.logwarn(
                    'a machine runs in a child process of the program, and without an oracle there'
                )
            return False
        with self._lock:
            if machine in self._left_bare or isinstance(machine, OracleContainer):
                return isinstance(machine, OracleContainer)
            with seen_to_run(machine):  # its program may wait for its end already
                self._wrap(machine)
            if not isinstance(machine, OracleContainer):  # those in it are wrapped by themselves
                self._left_bare[machine] = True
                return False
            self._wrapped[machine] = True
            for child in machines_inside(machine):
                if not isinstance(child, OracleContainer):
                    self._left_bare[child] = True
        return True

    def _leave(self, machine: smach.StateMachine) -> None:
        """Warn once where it is the program that has wrapped a machine."""
        with self._lock:
            if self._why_left is None or machine in self._wrapped:
                return
            text, self._why_left = self._why_left(machine), None
        if text:
            smach.logwarn(text)

    def _patch(self, cls: Type[smach.StateMachine]) -> None:
        original = cls.execute  # its own, or one that a mix-in brings
        if own_mark(original, MARK) or issubclass(cls, OracleContainer):
            return
        is_missed, before_execute = self.is_missed, self.before_execute

        @functools.wraps(original)
        def execute(machine: smach.StateMachine, *args: Any, **kwargs: Any) -> Any:
            if isinstance(machine, OracleContainer):
                if is_missed(machine):
                    return type(machine).execute(machine, *args, **kwargs)
                return original(machine, *args, **kwargs)
            with under_way(machine):
                if before_execute(machine):
                    # its class is another one now; the machine may have an `execute` of its own
                    return type(machine).execute(machine, *args, **kwargs)
            return original(machine, *args, **kwargs)

        setattr(execute, MARK, True)
        setattr(cls, 'execute', execute)

    def _patch_future_subclasses(self) -> None:
        inherited = smach.StateMachine.__dict__.get('__init_subclass__')
        patch = self._patch

        def __init_subclass__(cls: Type[smach.StateMachine], **kwargs: Any) -> None:
            if inherited is not None:
                inherited.__get__(None, cls)(**kwargs)
            else:
                super(smach.StateMachine, cls).__init_subclass__(**kwargs)
            patch(cls)

        setattr(smach.StateMachine, '__init_subclass__', classmethod(__init_subclass__))


def family(cls: type) -> Iterator[type]:
    """Yield a class and all that is derived from it so far."""
    yield cls
    for child in cls.__subclasses__():
        yield from family(child)


def machines_inside(container: smach.Container) -> Iterator[smach.StateMachine]:
    """Yield every StateMachine below a container, at any depth.

    It looks through Concurrences and Iterators.
    """
    seen = {id(container)}
    open_containers: List[smach.State] = [container]
    while open_containers:
        for child in _children(open_containers.pop()):
            if id(child) in seen:
                continue
            seen.add(id(child))
            open_containers.append(child)
            if isinstance(child, smach.StateMachine):
                yield child


def _children(state: smach.State) -> Tuple[smach.State, ...]:
    """The children of a container, none of any other state.

    An Iterator may have no contained state yet.
    """
    if not isinstance(state, smach.Container):
        return ()
    try:
        return tuple(state.get_children().values())
    except (AttributeError, TypeError):
        return ()
