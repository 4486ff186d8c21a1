"""Names of variants that differ in their memory."""

import re
from typing import Optional

from ..trial_rows import TrialRow

MEMORY = re.compile(r'(.+)_memory_(\d+)')


def memory_of(row: TrialRow) -> Optional[float]:
    """Return the memory that a variant is named by. None means by none."""
    named = MEMORY.fullmatch(row.variant)
    return float(named.group(2)) if named else None


def policy_of(row: TrialRow) -> str:
    """Return the name of a variant without its memory."""
    named = MEMORY.fullmatch(row.variant)
    return named.group(1) if named else row.variant
