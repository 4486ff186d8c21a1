"""Run a command with a time limit, and leave nothing of it behind.

roslaunch puts every node into a session of its own, so that killing the command, or its process
group, is not enough. Every process of a check therefore carries a mark in its environment, by which
its last descendant is found.
"""

import os
import signal
import subprocess
import threading
import time
import uuid
from pathlib import Path
from typing import Dict, List, NamedTuple, Optional

MARK = 'SMACH_ORACLE_CHECK'
# roslaunch alone would wait 15 s for a node that does not listen
STOP_GRACE_S = 5.0
# by which a command that gives way is nicer: it gets a quarter of a core beside another
NICE = 5


class Ended(NamedTuple):
    """How a command ended."""

    problem: str  # '' on success, else what went wrong
    processor_s: float  # user and system time, of the command and of all that it has waited for


class Runner:
    """Runs commands, from several threads if need be, until `stop` ends them all."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._running: List[subprocess.Popen] = []
        self.stopped = False

    def run(
        self,
        command: List[str],
        log: Path,
        timeout_s: float,
        cwd: Path,
        env: Optional[Dict[str, str]] = None,
        gives_way: bool = False,
    ) -> Ended:
        """Run `command` with its output in `log`.

        :param gives_way: others that want to run go before it.
        """
        mark = uuid.uuid4().hex
        log.parent.mkdir(parents=True, exist_ok=True)
        with log.open('wb') as output:
            with self._lock:
                if self.stopped:
                    return Ended('interrupted', 0.0)
                process = subprocess.Popen(
                    command,
                    stdout=output,
                    stderr=subprocess.STDOUT,
                    cwd=str(cwd),
                    stdin=subprocess.DEVNULL,
                    start_new_session=True,
                    env=dict(os.environ, **(env or {}), **{MARK: mark}),
                )
                self._running.append(process)
        if gives_way:
            _give_way(process.pid)
        try:
            ended = _wait(process, timeout_s)
        finally:
            with self._lock:
                self._running.remove(process)
            left = kill_marked(mark)
        if left:
            with log.open('a') as output:
                output.write('\nleft behind, and killed:\n  {}\n'.format('\n  '.join(left)))
        return ended._replace(problem='interrupted') if self.stopped else ended

    def stop(self) -> None:
        """End what runs, as Ctrl-C would, or by force where that takes long; start nothing any
        more.
        """
        with self._lock:
            self.stopped = True
            running = list(self._running)
        for process in running:
            _signal(process, signal.SIGINT)
        deadline = time.monotonic() + STOP_GRACE_S
        while time.monotonic() < deadline and any(process.poll() is None for process in running):
            time.sleep(0.05)
        for process in running:
            if process.poll() is None:
                _signal(process, signal.SIGKILL)


def _give_way(pid: int) -> None:
    """Let others go before a process that leads a session, and before what it starts, where the
    system can.
    """
    try:
        nice = min(19, os.getpriority(os.PRIO_PROCESS, 0) + NICE)
        os.setpriority(os.PRIO_PROCESS, pid, nice)
        # where the system shares its time by sessions first, a nice value counts within one alone
        Path('/proc', str(pid), 'autogroup').write_text(str(nice), encoding='ascii')
    except OSError:
        pass  # it has ended, or time is not shared so here


def _wait(process: subprocess.Popen, timeout_s: float) -> Ended:
    in_time = _has_ended(process, timeout_s)
    if not in_time:
        # roslaunch needs a while to take its nodes down one after the other
        for number, grace_s in ((signal.SIGINT, 20.0), (signal.SIGKILL, 5.0)):
            _signal(process, number)
            if _has_ended(process, grace_s):
                break
    processor_s = _processor_s(process.pid)
    if not in_time:
        process.poll()
        return Ended('not done after {:g} s'.format(timeout_s), processor_s)
    status = process.wait()
    if status < 0:
        return Ended('killed by {}'.format(signal.Signals(-status).name), processor_s)
    return Ended('exit status {}'.format(status) if status else '', processor_s)


def _has_ended(process: subprocess.Popen, timeout_s: float) -> bool:
    """Wait for it, and leave it to be read in /proc what it has used."""
    deadline = time.monotonic() + timeout_s
    while process.returncode is None:
        try:
            if os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT):
                break
        except ChildProcessError:
            break  # `Runner.stop` has seen its end
        if time.monotonic() > deadline:
            return False
        time.sleep(0.02)
    return True


def _processor_s(pid: int) -> float:
    try:
        stat = Path('/proc', str(pid), 'stat').read_text('utf-8')
    except OSError:
        return 0.0
    # behind the name: the times of itself and of its children, user and system, are 14 to 17
    ticks = [int(each) for each in stat.rsplit(')', 1)[1].split()[11:15]]
    return sum(ticks) / os.sysconf('SC_CLK_TCK')


def _signal(process: subprocess.Popen, number: int) -> None:
    try:
        os.killpg(process.pid, number)
    except ProcessLookupError:
        pass


def kill_marked(mark: str) -> List[str]:
    """Kill every process whose environment carries `mark`; return their command lines."""
    wanted = '{}={}'.format(MARK, mark).encode()
    killed = {}
    deadline = time.monotonic() + 5.0
    while time.monotonic() < deadline:
        found = [pid for pid in _pids() if wanted in _read(pid, 'environ').split(b'\0')]
        if not found:
            break
        for pid in found:
            killed[pid] = (
                _read(pid, 'cmdline').replace(b'\0', b' ').decode(errors='replace').strip()
            )
            try:
                os.kill(pid, signal.SIGKILL)
            except ProcessLookupError:
                pass
        time.sleep(0.05)
    return ['{} {}'.format(pid, command) for pid, command in sorted(killed.items())]


def _pids() -> List[int]:
    return [int(name) for name in os.listdir('/proc') if name.isdigit()]


def _read(pid: int, name: str) -> bytes:
    try:
        return Path('/proc', str(pid), name).read_bytes()
    except OSError:
        # gone meanwhile, or somebody else's
        return b''
