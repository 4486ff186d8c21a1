"""What doc/policies.md and doc/executive.md say, in tables and words, apart from the executive."""

import re
from fractions import Fraction
from pathlib import Path
from typing import Dict, Optional, Tuple

PAGE = Path(__file__).resolve().parents[4] / 'doc' / 'policies.md'
FAILING = ('aborted', 'failed', 'failure', 'error')
MODERATE_FROM, HIGH_FROM = Fraction('0.4'), Fraction('0.75')


def sounds_like_failure(outcome: str) -> bool:
    """Named like a failure: in any case, whole or after `_`, `-` or a change to a capital."""
    if outcome.lower() == 'preempted':
        return False
    parts = re.split(r'[_-]|(?<=[a-z0-9])(?=[A-Z])', outcome)
    return parts[-1].lower() in FAILING


def failing_outcome_of(outcomes: Tuple[str, ...]) -> Optional[str]:
    """The container outcome that stands for failure, None where there is none."""
    return next((name for name in outcomes if sounds_like_failure(name)), None)


def class_of(rate: Fraction) -> str:
    """LOW, MODERATE or HIGH."""
    if rate >= HIGH_FROM:
        return 'HIGH'
    return 'MODERATE' if rate >= MODERATE_FROM else 'LOW'


def _read_cells() -> Dict[Tuple[str, str, str, str], str]:
    """What is decided, by policy, class, preconditions and continuity: the table of the page."""
    cells = {}
    names = []
    for line in PAGE.read_text(encoding='utf-8').splitlines():
        row = [cell.strip() for cell in line.strip('|').split('|')]
        if row[:3] == ['class', 'preconditions', 'continuous']:
            names = row[3:]
        elif row[0] in ('LOW', 'MODERATE', 'HIGH') and len(row) == 3 + len(names):
            for name, action in zip(names, row[3:]):
                cells[name, row[0], row[1], row[2]] = action
    return cells


CELLS = _read_cells()


def decided(policy: str, rate_class: str, preconditions: str, continuous: bool) -> str:
    """Revisit, step back or ask."""
    return CELLS[policy, rate_class, preconditions, 'yes' if continuous else 'no']
