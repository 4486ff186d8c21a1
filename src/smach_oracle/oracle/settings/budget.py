"""The budget of a whole trial: what the oracle may spend, over all containers. Pure."""

import math
from dataclasses import dataclass
from typing import Optional

from ..errors import SettingsError
from . import checks as values
from .setting import checked, setting, settings_of

_COUNT = values.optional(values.whole(0, 'a whole number from 0'))


def _minutes(key: str, value: object) -> float:
    allowed = 'a number of minutes above 0'
    minutes = float(values.number(0, math.inf, allowed)(key, value))
    if not minutes:
        raise SettingsError(key, value, allowed)
    return minutes


@dataclass(frozen=True)
class Budget:
    """The most that all containers of a machine may spend in one trial. None means no limit."""

    recoveries: Optional[int] = setting(
        None, _COUNT, "decisions of the oracle's own that led to a state"
    )
    minutes: Optional[float] = setting(
        None, values.optional(_minutes), 'of monotonic time, from the beginning of the trial'
    )
    questions: Optional[int] = setting(None, _COUNT, 'failures that the expert is asked about')


def checked_budget(key: str, given: object) -> Budget:
    """Check for a budget. A limit that is not given, or is None, does not apply.

    :raises SettingsError: naming key, value and what is allowed.
    """
    limits = vars(given) if isinstance(given, Budget) else given
    return Budget(**checked(Budget, key + '.', values.section(key, limits, settings_of(Budget))))
