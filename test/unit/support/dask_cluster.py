"""A Dask scheduler and its workers, each a process of its own, on loopback."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, Dict, List, Optional

STARTED_S = 240.0  # on a machine with much to do


class DaskCluster:
    """A scheduler and some workers of one thread each: `with DaskCluster(folder, 2) as cluster`."""

    def __init__(
        self,
        folder: Path,
        workers: int,
        environment: Optional[Dict[str, str]] = None,
        arguments: Any = (),
        protocol: str = 'tcp',
    ) -> None:
        """`arguments`: of the scheduler and of each worker."""
        folder.mkdir(parents=True, exist_ok=True)
        self._folder = folder
        path = {'PYTHONPATH': os.pathsep.join(filter(None, sys.path))}
        self._environment = {**os.environ, **path, **(environment or {})}
        self._arguments = list(arguments)
        self._protocol = protocol
        self._count = workers
        self.workers: List['subprocess.Popen[bytes]'] = []
        self.address = ''

    def __enter__(self) -> 'DaskCluster':
        file = self._folder / 'scheduler.json'
        self.scheduler = self._start(
            'scheduler',
            ['--host', '127.0.0.1', '--port', '0', '--dashboard-address', '127.0.0.1:0'],
            ['--protocol', self._protocol, '--scheduler-file', str(file)],
        )
        deadline = time.monotonic() + STARTED_S
        while not self.address:
            assert time.monotonic() < deadline and self.scheduler.poll() is None, self.log()
            try:
                self.address = json.loads(file.read_text())['address']
            except (OSError, ValueError, KeyError):
                time.sleep(0.1)  # the file that names the address is all that it says of itself
        self.workers = [
            self._start('worker', [self.address, '--nthreads', '1', '--no-nanny'])
            for _ in range(self._count)
        ]
        while self.log().count('Starting established connection to') < 2 * self._count:
            assert time.monotonic() < deadline, self.log()
            assert not any(worker.poll() for worker in self.workers), self.log()
            time.sleep(0.1)  # until the logs of all of them say it
        return self

    def _start(self, what: str, *arguments: List[str]) -> 'subprocess.Popen[bytes]':
        command = [sys.executable, '-m', 'distributed.cli.dask_' + what, *sum(arguments, [])]
        with (self._folder / 'log').open('ab') as log:
            return subprocess.Popen(
                [*command, '--no-dashboard', *self._arguments],
                stdout=log,
                stderr=log,
                cwd=str(self._folder),
                env=self._environment,
            )

    def log(self) -> str:
        """What all of them have said."""
        return (self._folder / 'log').read_text(errors='replace')

    def __exit__(self, *_: object) -> None:
        for process in [*self.workers, self.scheduler]:
            process.kill()
            process.wait()


def count_or_die(flag: str, events: List[Any]) -> int:
    """Return how many events a trial has. The first process with the flag's file dies of it."""
    try:
        os.unlink(flag)
    except FileNotFoundError:
        return len(events)
    os.kill(os.getpid(), signal.SIGKILL)
    return 0
