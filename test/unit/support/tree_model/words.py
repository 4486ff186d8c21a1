"""What doc/policies.md and doc/executive.md say, in tables and words, apart from the executive."""

import re
from fractions import Fraction
from pathlib import Path
from typing import Dict, List, Optional, Tuple

PAGE = Path(__file__).resolve().parents[4] / 'doc' / 'policies.md'
FAILING = ('aborted', 'failed', 'failure', 'error', 'abort', 'fail', 'unreachable', 'lost')
SUCCEEDING = ('succeeded', 'success', 'successful', 'completed')
MODERATE_FROM, HIGH_FROM = Fraction('0.4'), Fraction('0.75')


def sounds_like_failure(outcome: str) -> bool:
    """Named like a failure: its first word is, or its last. The names drawn negate nothing."""
    words = _words(outcome)
    return words[0] in FAILING or words[-1] in FAILING


def sounds_like_success(outcome: str) -> bool:
    """Named like a success: its last word is."""
    return _words(outcome)[-1] in SUCCEEDING


def _words(outcome: str) -> List[str]:
    """In small letters. A word begins after `_` or `-`, and with a capital."""
    return [word.lower() for word in re.split(r'[_-]|(?<=[a-z0-9])(?=[A-Z])', outcome)]


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
