"""Keeps one command and everything that it starts.

It ends all of it when its standard input closes.

It is run as a program, by its path and in isolation (`python3 -I`), with the standard library only.
Its arguments are the limits after SIGINT and after SIGTERM (s), then the command. The process that
started it holds the other end of the pipe: if that process dies, in whatever way, the pipe closes
as well. All descendants stay its own, also those that begin a session of their own, because it is
their subreaper.
"""

import ctypes
import os
import select
import signal
import subprocess
import sys
import time
from typing import Any, Callable, Dict, List, Sequence, Tuple

_PERIOD_S = 0.05
_PR_SET_PDEATHSIG = 1
_PR_SET_CHILD_SUBREAPER = 36


def descendants(root: int) -> List[int]:
    """Return the process ids of all descendants of a process.

    Those that have ended count until they are collected.
    """
    children: Dict[int, List[int]] = {}
    for name in os.listdir('/proc'):
        if name.isdigit():
            try:
                # a name may be cut within a letter
                with open('/proc/{}/stat'.format(name), 'rb') as file:
                    parent = file.read().rpartition(b')')[2].split()[1]
            except (OSError, IndexError):
                continue
            children.setdefault(int(parent), []).append(int(name))
    found: List[int] = []
    waiting = [root]
    while waiting:
        fresh = children.get(waiting.pop(), [])
        found += fresh
        waiting += fresh
    return found


def _reap() -> List[Tuple[int, int]]:
    """Return all that have ended, as (process id, status) of each."""
    ended: List[Tuple[int, int]] = []
    while True:
        try:
            pid, status = os.waitpid(-1, os.WNOHANG)
        except ChildProcessError:
            return ended
        if not pid:
            return ended
        ended.append((pid, status))


def _send(pids: Sequence[int], number: int) -> None:
    for pid in pids:
        try:
            os.kill(pid, number)
        except ProcessLookupError:
            pass


def _gone_within(limit_s: float) -> bool:
    until_s = time.monotonic() + limit_s
    while True:
        _reap()
        if not descendants(os.getpid()):
            return True
        if time.monotonic() > until_s:
            return False
        time.sleep(_PERIOD_S)


def end_all(main_pid: int, interrupt_s: float, terminate_s: float) -> None:
    """End everything: SIGINT to the command, SIGTERM to all that is left, SIGKILL.

    The command ends its children in order.
    """
    left = descendants(os.getpid())
    _send([main_pid] if main_pid in left else left, signal.SIGINT)
    if _gone_within(interrupt_s):
        return
    _send(descendants(os.getpid()), signal.SIGTERM)
    if _gone_within(terminate_s):
        return
    while not _gone_within(0.5):
        _send(descendants(os.getpid()), signal.SIGKILL)


def _prepare(prctl: Callable[..., Any]) -> None:
    os.setsid()
    prctl(_PR_SET_PDEATHSIG, signal.SIGINT, 0, 0, 0)
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def _raise_exit(*_: object) -> None:
    raise SystemExit(0)


def main(interrupt_s: float, terminate_s: float, command: Sequence[str]) -> int:
    """Run the command. The exit code is its own, 127 where it cannot be started."""
    prctl = ctypes.CDLL(None).prctl
    prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _raise_exit)
    try:
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, preexec_fn=lambda: _prepare(prctl)
        )
    except OSError as err:
        print('{}: {}'.format(command[0], err), flush=True)
        return 127
    code = 0
    try:
        while True:
            for pid, status in _reap():
                if pid == process.pid:
                    code = (
                        os.WEXITSTATUS(status)
                        if os.WIFEXITED(status)
                        else 128 + os.WTERMSIG(status)
                    )
                    return code
            if select.select([0], [], [], _PERIOD_S)[0] and not os.read(0, 1024):
                return code
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        os.close(1)  # what ends now is not worth a line, and nobody may be left to read it
        os.open(os.devnull, os.O_WRONLY)
        end_all(process.pid, interrupt_s, terminate_s)


if __name__ == '__main__':
    sys.exit(main(float(sys.argv[1]), float(sys.argv[2]), sys.argv[3:]))
