"""One roslaunch with a master of its own, whose last descendant is found again.

A later experiment finds what one that crashed has left.
"""

import ctypes
import errno
import os
import random
import signal
import socket
import subprocess
import time
from functools import partial
from pathlib import Path
from typing import IO, Any, Dict, List, Mapping, Optional

LOG_FILE = 'launch.log'
MARK = 'SMACH_ORACLE_JOB'  # in the environment of every process of a job: the job's folder
# s, before roslaunch kills a node that does not end. On a busy machine the world takes some for the
# last trial's line of truth
NODE_STOP = ['--sigint-timeout', '15', '--sigterm-timeout', '2']
STOP_S = 40.0  # for roslaunch to do so with the nodes, rosout and the master, one after the other
KILL_S = 10.0  # for the kernel to take away what was killed
# of which those are used that the system does not give to others by itself
PORTS = range(20000, 65536)
# the first and the last of these (Linux)
GIVEN_BY_CHANCE = Path('/proc/sys/net/ipv4/ip_local_port_range')
_PR_SET_PDEATHSIG = 1


class Launch:
    """A running roslaunch.

    Its output goes to the end of `launch.log` in the job's folder, ROS's logs to `log`.
    """

    def __init__(
        self,
        folder: Path,
        launch_file: str,
        arguments: Mapping[str, Any],
        core: Optional[int] = None,
    ) -> None:
        """Start it.

        :param core: processor core on which all its processes stay. None means any.
        :raises OSError: where that cannot be done.
        """
        self._mark = str(folder)
        port = free_port()
        self.environment = environment_of(folder, port)  # of its processes
        command = ['roslaunch', *NODE_STOP, '--port', str(port), 'smach_oracle', launch_file]
        command += ['{}:={}'.format(key, value) for key, value in arguments.items()]
        self._log_file: IO[str] = (folder / LOG_FILE).open('a')
        self._process = subprocess.Popen(
            command,
            env=self.environment,
            stdout=self._log_file,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            preexec_fn=partial(_begin, core),
        )

    def running(self) -> bool:
        """Whether roslaunch has not ended."""
        return self._process.poll() is None

    def request_stop(self) -> None:
        """Ask the launch to end with all its nodes."""
        if self.running():
            self._process.send_signal(signal.SIGINT)

    def stop(self) -> None:
        """End the launch and all its nodes."""
        self.request_stop()
        try:
            self._process.wait(STOP_S)
        except subprocess.TimeoutExpired:
            pass
        end_marked(self._mark)
        self._process.wait()
        self._log_file.close()


def environment_of(folder: Path, port: int) -> Dict[str, str]:
    """The environment of a job's processes, with a master of its own, whatever the shell has set.

    Jobs run side by side, each with several nodes: more threads in one of them would only be in the
    others' way.
    """
    caller = {
        name: value for name, value in os.environ.items() if name not in ('ROS_NAMESPACE', 'ROS_IP')
    }
    threads = {name: caller.get(name, '1') for name in ('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS')}
    return {
        **caller,
        **threads,
        'ROS_MASTER_URI': 'http://localhost:{}'.format(port),
        'ROS_HOSTNAME': 'localhost',
        'ROS_LOG_DIR': str(folder / 'log'),
        'PYTHONUNBUFFERED': '1',
        MARK: str(folder),
    }


def size_of(log: Path) -> int:
    """Return the size of a log in bytes, or 0 where there is none."""
    try:
        return log.stat().st_size
    except OSError:
        return 0


def last_words(log: Path, count: int = 6) -> str:
    """The last lines of a log, each on a line of its own, or '' where there is none."""
    if not log.exists():
        return ''
    lines = [
        line
        for line in log.read_text(encoding='utf-8', errors='replace').splitlines()
        if line.strip()
    ]
    return ''.join('\n  ' + line for line in lines[-count:])


def _begin(core: Optional[int]) -> None:
    end_with_parent()
    if core is not None:
        os.sched_setaffinity(0, {core})


def end_with_parent() -> None:
    """Have the kernel send SIGINT to this process when its parent is killed (Linux).

    Called in a child before it becomes another program.
    """
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGINT)


def free_port() -> int:
    """A free TCP port of the loopback interface that the system does not give by itself."""
    chance = random.SystemRandom()
    given = given_by_chance()
    ports = [port for port in PORTS if port not in given] or PORTS
    while True:
        port = chance.choice(ports)
        with socket.socket() as probe:
            try:
                probe.bind(('localhost', port))
            except OSError as err:
                if err.errno != errno.EADDRINUSE:
                    raise
                continue
            return port


def given_by_chance() -> range:
    """The ports that the system gives by itself. Those of Linux where that cannot be read."""
    try:
        first, last = map(int, GIVEN_BY_CHANCE.read_text(encoding='ascii').split())
    except (OSError, ValueError):
        first, last = 32768, 60999
    return range(first, last + 1)


def marked(mark: str) -> List[int]:
    """Processes of a job, by the mark in their environment."""
    wanted = os.fsencode('{}={}'.format(MARK, mark))
    found = []
    for entry in Path('/proc').glob('[0-9]*'):
        environment = _environment(entry)
        if environment is not None and wanted in environment.split(b'\0'):
            found.append(int(entry.name))
    return found


def _environment(entry: Path) -> Optional[bytes]:
    try:
        return (entry / 'environ').read_bytes()
    except OSError:
        return None  # it has ended meanwhile, or is somebody else's


def end_marked(mark: str, grace_s: float = 0.0) -> int:
    """End every process of a job: asked first where there is grace, killed after it.

    :returns: how many there were.
    """
    found = marked(mark)
    if found and grace_s:
        _send_all(mark, signal.SIGINT, grace_s)
    _send_all(mark, signal.SIGKILL, KILL_S)
    return len(found)


def _send_all(mark: str, number: int, wait_s: float) -> None:
    for pid in marked(mark):
        try:
            os.kill(pid, number)
        except ProcessLookupError:
            pass  # it has ended meanwhile
    until = time.monotonic() + wait_s
    while marked(mark) and time.monotonic() < until:
        time.sleep(0.05)
