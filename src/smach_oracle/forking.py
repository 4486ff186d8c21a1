"""Decides what a child process gets of the things that its program has once: nothing.

A part that a process has once says here what becomes of it in a forked child: a wake-up file
descriptor, an open bag, a store, the trial that runs. The child then neither uses it nor reports to
it. SIGINT and SIGTERM wait in a thread that forks until the child has let go of everything.
"""

import contextlib
import fcntl
import os
import signal
import sys
import threading
import traceback
import weakref
from types import MethodType
from typing import Any, Callable, Dict, List, Set, Tuple

_ENDING = (signal.SIGINT, signal.SIGTERM)

Decision = Callable[[], None]

_of_functions: List[Decision] = []
# by the id of the owner and the name of its method: an owner that is gone needs no decision
_of_objects: Dict[Tuple[int, str], Tuple['weakref.ref[object]', Callable[[Any], None]]] = {}
_masks: Dict[int, Set[int]] = {}  # of threads that fork now, as they were before
_forked = False
process = os.getpid()  # id of this process, kept since each execution of a container asks for it


def in_child(decision: Decision) -> None:
    """Call a function in each child that this process forks, before the child goes on.

    It must take no lock: a thread may have held it that the child does not have. A method is called
    as long as its object lives.
    """
    if not isinstance(decision, MethodType):
        _of_functions.append(decision)
        return
    key = id(decision.__self__), decision.__name__

    # at exit the names of the module may be gone, a default argument is not
    def forget(gone: object, kept: Dict[Tuple[int, str], Any] = _of_objects) -> None:
        if key in kept and kept[key][0] is gone:
            del kept[key]

    _of_objects[key] = weakref.ref(decision.__self__, forget), decision.__func__


def is_child() -> bool:
    """Whether this process is forked, or `multiprocessing` has started it for another one."""
    if _forked:
        return True
    processes = sys.modules.get('multiprocessing.process')
    return processes is not None and processes.parent_process() is not None


def let_go_of(descriptor: int) -> None:
    """Have a file of the parent no longer open in a child.

    The descriptor leads to /dev/null then, so that whoever still closes it closes nothing else.
    """
    nothing = os.open(os.devnull, os.O_RDWR | os.O_CLOEXEC)
    try:
        os.dup2(nothing, descriptor, inheritable=False)
    finally:
        os.close(nothing)


def unlock(descriptor: int) -> None:
    """Release the lock of a file that is about to be closed.

    Closing alone keeps the lock as long as a child lives that was forked meanwhile. A file without
    a lock, or on a file system without locks, stays as it is.
    """
    with contextlib.suppress(OSError):
        fcntl.flock(descriptor, fcntl.LOCK_UN)


def _before() -> None:
    _masks[threading.get_ident()] = signal.pthread_sigmask(signal.SIG_BLOCK, _ENDING)


def _after() -> None:
    signal.pthread_sigmask(signal.SIG_SETMASK, _masks.pop(threading.get_ident()))


def _decide() -> None:
    global _forked, process
    _forked, process = True, os.getpid()
    mask = _masks.pop(threading.get_ident())
    _masks.clear()
    owned = [(owner(), function) for owner, function in list(_of_objects.values())]
    methods = [MethodType(function, owner) for owner, function in owned if owner is not None]
    for decision in _of_functions + methods:
        try:
            decision()
        except Exception:  # the others are due anyway
            traceback.print_exc()
    signal.pthread_sigmask(signal.SIG_SETMASK, mask)


os.register_at_fork(before=_before, after_in_parent=_after, after_in_child=_decide)
