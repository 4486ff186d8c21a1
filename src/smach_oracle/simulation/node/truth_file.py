"""Writes lines of truth. It needs no world."""

import json
import os
from typing import Any, Mapping


def append_line(path: str, record: Mapping[str, Any]) -> None:
    """Append a line that is on the disk when this returns.

    :raises OSError: where it cannot be written.
    """
    with open(path, 'a', encoding='utf-8') as file:
        file.write(json.dumps(record, allow_nan=False) + '\n')
        file.flush()
        os.fsync(file.fileno())
