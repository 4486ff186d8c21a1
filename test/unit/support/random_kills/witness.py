"""A journal beside the store: what states and events have said, on the disk before they go on."""

import json
import os
import threading
from typing import Any, Dict, List


class Journal:
    """A file to which any thread adds lines; each is on the disk when `write` returns."""

    def __init__(self, path: str, run: int) -> None:
        """`run`: number of the process. A line that the kill cut off is taken away."""
        self._run = run
        self._file = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
        with open(path, 'rb') as stream:
            os.truncate(path, stream.read().rfind(b'\n') + 1)

    def write(self, what: str, **told: Any) -> None:
        """Add one line. A kill at the border of a page of memory may cut it off."""
        line = dict(told, what=what, run=self._run, thread=threading.get_ident())
        os.write(self._file, (json.dumps(line) + '\n').encode())
        os.fsync(self._file)


def read_journal(path: str) -> List[Dict[str, Any]]:
    """The lines so far, without one that was cut off."""
    with open(path) as stream:
        return [json.loads(line) for line in stream if line.endswith('\n')]
