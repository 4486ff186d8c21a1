"""Ends a program by force, and its child processes before."""

import os
import sys
import time
from typing import Any, List

CHILDREN_S = 0.2  # for child processes to end by SIGTERM
_LOOK_S = 0.01


def end_program(exit_code: int) -> None:
    """End this process on the spot, once its children have ended."""
    _end_children()
    os._exit(exit_code)


def _end_children() -> None:
    """End the processes that `multiprocessing` ends or awaits where a program ends by itself.

    None begins from here on: a Pool would put new workers in the place of those that end.
    """
    processes: Any = sys.modules.get('multiprocessing.process')
    if processes is None:
        return
    setattr(processes.BaseProcess, 'start', _never_begin)
    until = time.monotonic() + CHILDREN_S
    told: List[Any] = []
    while True:
        left = processes.active_children()
        for child in left:
            if not any(child is each for each in told):
                told.append(child)
                child.terminate()
        if time.monotonic() >= until:
            break
        time.sleep(_LOOK_S)  # one that another thread had begun to start is there now
        if not left and not processes.active_children():
            return
    for child in processes.active_children():
        child.kill()


def _never_begin(process: object) -> None:
    """Hold a thread that would start a process until this one is gone."""
    while True:
        time.sleep(1.0)
