"""Launches of jobs on the machines of a Dask cluster, which all see the folder of the experiment.

Three processes share a launch. This one writes into the job's folder what it wants of the launch,
again and again. A worker runs a helper, and the helper runs roslaunch as this machine would. It
stops that when it is told to, when nothing is written any more, and when its worker dies. A lock in
the folder tells when it is done with that.

A worker that dies loses its launch. Dask then gives the work to another worker, which refuses it:
the launch has been claimed. So the job looks through its folder, and starts the trial again.
"""

import errno
import fcntl
import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import FrameType
from typing import IO, Any, Dict, Mapping, Optional

from smach_oracle.cluster import ClusterError, WorkerCluster, WorkersLost
from smach_oracle.forking import unlock

from .launching import KILL_S, STOP_S, Launch, end_marked, end_with_parent
from .plan import write_text

WANTED_FILE = '.wanted'  # token, what is wanted of that launch, and a number that grows
CLAIM_FILE = '.claimed_{}'  # of a launch that a worker has begun
RUNNING_FILE = '.running'  # locked by the helper, with the token of its launch in it
RUN, STOP = 'run', 'stop'
WRITE_EVERY_S = 5.0
LEASE_S = 60.0  # without anything new in the file, after which nobody wants the launch any more
LOOK_S = 0.5
GONE_S = STOP_S + KILL_S + 10.0  # for a helper to end its launch
_NO_LOCKS_HERE = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP, errno.EINVAL)


class ClusterLaunch:
    """A launch on a worker. It is used as a `Launch` of this machine is."""

    def __init__(
        self, cluster: WorkerCluster, folder: Path, launch_file: str, arguments: Mapping[str, Any]
    ) -> None:
        """Hand it to the cluster.

        :raises ClusterError: where the scheduler is gone.
        :raises OSError: where the folder cannot be written.
        """
        self._cluster = cluster
        self._folder = folder
        self._token = os.urandom(8).hex()
        self._over = threading.Event()
        self._write_wanted(RUN, 0)
        self._writer = threading.Thread(target=self._keep_wanted, name='job lease', daemon=True)
        self._writer.start()
        given = {key: str(value) for key, value in arguments.items()}
        try:
            self._future = cluster.submit(
                run_in_worker, str(folder), self._token, launch_file, given
            )
        except BaseException:
            self._over.set()
            raise

    def _write_wanted(self, what: str, number: int) -> None:
        text = '{} {} {}\n'.format(self._token, what, number)
        write_text(self._folder / WANTED_FILE, text)

    def _keep_wanted(self) -> None:
        number = 0
        while not self._over.wait(WRITE_EVERY_S):
            number += 1
            try:
                self._write_wanted(RUN, number)
            except OSError:
                continue  # a full disk, say. The launch ends if that lasts

    @property
    def waits(self) -> bool:
        """Whether no worker has begun it yet.

        :raises ClusterError: where none is left that could.
        """
        if self._future.done() or (self._folder / CLAIM_FILE.format(self._token)).exists():
            return False
        if self._cluster.deserted():
            raise ClusterError('no worker is left at {}'.format(self._cluster.address))
        return True

    def running(self) -> bool:
        """Whether it has not ended. It has not begun, perhaps."""
        return not (self._future.done() or self._helper_gone())

    def _helper_gone(self) -> bool:
        """Whether the helper had the lock, and has it no longer."""
        try:
            with (self._folder / RUNNING_FILE).open('r+') as lock:
                if lock.read() != self._token or not lock_within(lock, 0.0):
                    return False
                unlock(lock.fileno())
                return True
        except FileNotFoundError:
            return False

    def request_stop(self) -> None:
        """Ask the launch to end with all its nodes.

        :raises OSError: where the folder cannot be written.
        """
        if not self._over.is_set():
            self._over.set()
            self._writer.join()
            self._write_wanted(STOP, 0)

    def stop(self) -> None:
        """End the launch and all its nodes, as far as its machine is there.

        :raises OSError: where the folder cannot be written.
        :raises ClusterError: where the worker could not start it, or none is left.
        """
        self.request_stop()
        deadline = time.monotonic() + GONE_S
        while self.running() and not self.waits and time.monotonic() < deadline:
            time.sleep(LOOK_S)
        try:
            if self._future.done():
                self._cluster.result(self._future)
        except WorkersLost:
            pass  # the helper ends what they have left
        finally:
            self._future.cancel()
            with (self._folder / RUNNING_FILE).open('a') as lock:
                if lock_within(lock, GONE_S):
                    unlock(lock.fileno())
            for name in (WANTED_FILE, CLAIM_FILE.format(self._token)):
                try:
                    (self._folder / name).unlink()
                except FileNotFoundError:
                    pass


def run_in_worker(folder: str, token: str, launch_file: str, arguments: Dict[str, str]) -> str:
    """Run a launch to its end, in a worker. Return what became of it.

    :raises OSError: where the folder cannot be written.
    """
    try:
        os.close(os.open(os.path.join(folder, CLAIM_FILE.format(token)), os.O_CREAT | os.O_EXCL))
    except FileExistsError:
        return 'the worker that had begun it is gone'
    told = json.dumps([os.getpid(), folder, token, launch_file, arguments])
    # a process of its own: it outlives this one for as long as it takes to end everything
    helper = subprocess.Popen(
        [sys.executable, '-m', __name__, told], stdin=subprocess.DEVNULL, start_new_session=True
    )
    return 'exit code {}'.format(helper.wait())


def lock_within(file: IO[str], longest_s: float) -> bool:
    """Lock a file that another process may hold, and return whether that went."""
    deadline = time.monotonic() + longest_s
    while True:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return True
        except OSError as err:
            if err.errno in _NO_LOCKS_HERE or time.monotonic() > deadline:
                return False
        time.sleep(LOOK_S)


class _Wanted:
    """What is wanted of a launch, by the file in its folder."""

    def __init__(self, folder: Path, token: str) -> None:
        self._path = folder / WANTED_FILE
        self._token = token
        self._text = ''
        self._changed_at = time.monotonic()

    def __bool__(self) -> bool:
        """Whether somebody wants the launch to go on."""
        try:
            text = self._path.read_text(encoding='ascii')
        except OSError:  # a network's file system may be away for a while
            text = self._text
        if text != self._text:
            self._text, self._changed_at = text, time.monotonic()
        if text.split()[:2] != [self._token, RUN]:
            return False
        return time.monotonic() - self._changed_at < LEASE_S


def main() -> int:
    """Run a launch for the worker whose child this is."""
    parent, folder_name, token, launch_file, arguments = json.loads(sys.argv[1])
    ended = False

    def note(_signum: int, _frame: Optional[FrameType]) -> None:
        nonlocal ended
        ended = True

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, note)
    end_with_parent()
    folder = Path(folder_name)
    with (folder / RUNNING_FILE).open('a') as lock:
        lock_within(lock, GONE_S)  # that of an earlier launch, whose worker died
        lock.truncate(0)
        lock.write(token)
        lock.flush()
        end_marked(folder_name)
        wanted = _Wanted(folder, token)
        if os.getppid() != parent or ended or not wanted:
            return 0
        launch = Launch(folder, launch_file, arguments)
        try:
            while launch.running() and not ended and wanted:
                time.sleep(LOOK_S)
        finally:
            launch.stop()
    return 0


if __name__ == '__main__':
    sys.exit(main())
