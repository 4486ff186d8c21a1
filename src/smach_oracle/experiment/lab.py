"""What a world that goes on is told when it starts: the run, and how the last trial left it."""
from pathlib import Path
from typing import Any, Mapping, Optional

from .plan import ExperimentPlan, write_json

LAB_FILE = 'lab.json'


def write_lab(folder: Path, first_seed: int, plan: ExperimentPlan,
              left: Optional[Mapping[str, Any]]) -> None:
    """Write the file for a job whose world goes on over the hours of its plan.

    :param left: how the last trial left it, as its row tells; None: it begins.
    :raises OSError: where it cannot be written.
    """
    assert plan.hours is not None
    write_json(folder / LAB_FILE, {'seed': first_seed, 'slot_h': plan.hours / plan.trials,
                                   'left': left})
