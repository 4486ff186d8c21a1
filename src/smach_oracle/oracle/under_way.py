"""The machines that are under way: their `execute` was called, and has not returned.

The engine notes only that it steps. An oracle is at work before and after that: it joins the node,
opens a store, closes a bag.
"""

import threading
from contextlib import contextmanager
from typing import Iterator, List, Tuple

import smach

from .smach_private import is_executing, set_executing

_calls: List[Tuple[int, int]] = []  # the id of a machine and of a thread, for each call


@contextmanager
def under_way(machine: smach.StateMachine) -> Iterator[None]:
    """Note in the body that this thread executes the machine."""
    call = id(machine), threading.get_ident()
    _calls.append(call)
    try:
        yield
    finally:
        _calls.remove(call)


def is_under_way(machine: smach.StateMachine) -> bool:
    """Whether any thread executes the machine."""
    return any(each == id(machine) for each, _ in list(_calls))


def is_under_way_elsewhere(machine: smach.StateMachine) -> bool:
    """Whether another thread than this one executes the machine."""
    mine = threading.get_ident()
    return any(each == id(machine) and thread != mine for each, thread in list(_calls))


def is_stepping(machine: smach.StateMachine) -> bool:
    """Whether the engine executes the machine."""
    return is_executing(machine)


@contextmanager
def seen_to_run(machine: smach.StateMachine) -> Iterator[None]:
    """Have a bare machine say in the body that it runs, before its engine has begun."""
    set_executing(machine, True)
    try:
        yield
    finally:
        set_executing(machine, False)
