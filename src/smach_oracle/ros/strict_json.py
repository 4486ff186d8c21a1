"""JSON as the standard has it: Python alone also takes NaN, and makes infinity of 1e999. Pure."""

import json
import math
from typing import Any, NoReturn


def load_json(text: str) -> Any:
    """Return the value of a JSON text.

    :raises ValueError: where it is not JSON, or holds NaN, Infinity or a
        number that is too large for a float (1e999).
    :raises RecursionError: where it is nested too deep.
    """
    return json.loads(text, parse_constant=_refuse_constant, parse_float=_finite)


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError('{} is not a JSON number'.format(name))


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError('{} is too large for a number'.format(text))
    return number
