"""The tests of a copy of the tree, collected once in a process of pytest (see `forking`)."""

import contextlib
import json
import shutil
import socket
import threading
import time
from pathlib import Path
from typing import Callable, Dict, NamedTuple, Optional, Sequence, TextIO, Tuple

from . import forking

LIMIT_S = 600.0  # of collecting


class TestsNotRun(Exception):
    """pytest could not run the tests. The text has its output."""


class Ending(NamedTuple):
    """How a run of tests has ended."""

    is_fine: bool
    is_hung: bool
    took_s: float
    by: str  # the test that has failed, '' where none is named


class Collected:
    """pytest, which has collected tests and forks for each run of some of them."""

    def __init__(self, run_pytest: Callable[[Dict[str, str]], str], folder: Path) -> None:
        """:param run_pytest: run it with the plugin `forking` and this environment, and return what
            it said in the end.
        :param folder: of its own, to be made.

        :raises TestsNotRun: where it ends before it has collected.
        """
        self._said = ''
        folder.mkdir()
        shutil.copy(forking.__file__, str(folder))  # alone: the tests have helpers of their own
        address = folder / 'asked'

        def run() -> None:
            self._said = run_pytest({forking.ASKED_BY: str(address), 'PYTHONPATH': str(folder)})

        self._thread = threading.Thread(target=run)
        with socket.socket(socket.AF_UNIX) as listening:
            listening.bind(str(address))
            listening.listen(1)
            listening.settimeout(1.0)
            self._thread.start()
            self._connection, self._lines = self._accepted(listening)

    def _accepted(self, listening: socket.socket) -> Tuple[socket.socket, TextIO]:
        deadline_s = time.monotonic() + LIMIT_S
        while True:
            try:
                connection, _ = listening.accept()
            except socket.timeout:
                if not self._thread.is_alive():
                    raise TestsNotRun(self._said) from None
                if time.monotonic() > deadline_s:
                    raise TestsNotRun('not collected after {:g} s'.format(LIMIT_S)) from None
            else:
                connection.settimeout(None)
                return connection, connection.makefile('rw')

    def run(self, module: Path, tests: Sequence[str], limit_s: float) -> Optional[Ending]:
        """Run tests with the change of a module that is on the disk.

        :return: None where only a new process can: the change is in what ran on import, or a test
            has another name.
        :raises TestsNotRun: where pytest is gone.
        """
        begun_s = time.monotonic()
        asked = {'module': str(module), 'tests': list(tests), 'limit_s': limit_s}
        try:
            print(json.dumps(asked), file=self._lines, flush=True)
            line = self._lines.readline()
        except OSError:
            line = ''
        if not line:
            self._thread.join()
            raise TestsNotRun(self._said)
        answer = json.loads(line)
        if not answer.pop('is_taken'):
            return None
        return Ending(took_s=time.monotonic() - begun_s, **answer)

    def close(self) -> None:
        """Let pytest end, and wait for that."""
        with contextlib.suppress(OSError):  # what could not be said to one that is gone
            self._lines.close()
        self._connection.close()
        self._thread.join()
