"""The input with which a world that goes on starts: the run, and how the last trial left it."""

from pathlib import Path
from typing import Any, Mapping, Optional

from .plan import write_json

LAB_FILE = 'lab.json'


def write_lab(
    folder: Path, first_seed: int, slot_h: float, left: Optional[Mapping[str, Any]]
) -> None:
    """Write the file for a job whose world goes on.

    :param slot_h: h from the begin of one trial to that of the next, where none takes longer.
    :param left: how the last trial left it, as its row tells. None means it begins.
    :raises OSError: where it cannot be written.
    """
    write_json(folder / LAB_FILE, {'seed': first_seed, 'slot_h': slot_h, 'left': left})
