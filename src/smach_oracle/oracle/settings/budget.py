"""The budget of a whole trial: what the oracle may spend, over all containers. Pure."""

import math
from typing import Any, Dict, NamedTuple, Optional

from ..errors import SettingsError
from . import checks as values


class Budget(NamedTuple):
    """The most that all containers of a machine may spend in one trial. None means no limit."""

    recoveries: Optional[int] = None  # decisions of the oracle's own that led to a state
    minutes: Optional[float] = None  # of monotonic time, from the beginning of the trial
    questions: Optional[int] = None  # failures that the expert is asked about


def _minutes(key: str, value: object) -> float:
    allowed = 'a number of minutes above 0'
    minutes = float(values.number(0, math.inf, allowed)(key, value))
    if not minutes:
        raise SettingsError(key, value, allowed)
    return minutes


_CHECKS: Dict[str, values.Check] = {
    'recoveries': values.whole(0, 'a whole number from 0'),
    'minutes': _minutes,
    'questions': values.whole(0, 'a whole number from 0'),
}


def checked_budget(key: str, given: object) -> Budget:
    """Check for a budget. A limit that is not given, or is None, does not apply.

    :raises SettingsError: naming key, value and what is allowed.
    """
    if isinstance(given, Budget):
        given = given._asdict()
    limits: Dict[str, Any] = {}
    for name, value in values.mapping(key, given).items():
        if name not in _CHECKS:
            raise SettingsError(
                '{}.{}'.format(key, name), value, 'one of the keys ' + ', '.join(_CHECKS)
            )
        limits[name] = values.optional(_CHECKS[name])('{}.{}'.format(key, name), value)
    return Budget(**limits)
