"""The world's log of the causes of a trial, as it stands in a row."""

import json
from typing import Any, List, Mapping, NamedTuple, Optional, Sequence


class LoggedCause(NamedTuple):
    """One cause of a trial. Times are s of the world's time since the trial began."""

    kind: str
    lasting: bool  # by its class
    began_s: Optional[float]  # None: it never came
    ended_s: Optional[float]  # None: it was there at the trial's end

    def there_at(self, second: float) -> bool:
        """Whether it was there at a moment."""
        if self.began_s is None or second < self.began_s:
            return False
        return self.ended_s is None or second < self.ended_s


def causes_of(told: object) -> Optional[List[LoggedCause]]:
    """Return the causes that a line of truth tells. None where it lacks their times."""
    if not isinstance(told, list) or not all(map(_is_logged, told)):
        return None
    return [
        LoggedCause(each['kind'], each['lasting'], each['began_s'], each['ended_s'])
        for each in told
    ]


def _is_logged(cause: Any) -> bool:
    return (
        isinstance(cause, Mapping)
        and isinstance(cause.get('lasting'), bool)
        and isinstance(cause.get('kind'), str)
        and all(
            name in cause and isinstance(cause[name], (int, float, type(None)))
            for name in ('began_s', 'ended_s')
        )
    )


def causes_text(causes: Sequence[LoggedCause]) -> str:
    """Return the causes as they stand in a row."""
    return json.dumps([list(each) for each in causes], separators=(',', ':'))


def causes_in(text: str) -> List[LoggedCause]:
    """Return the causes of a row.

    :raises ValueError or TypeError: where the text is none of causes_text().
    """
    found = causes_of([dict(zip(LoggedCause._fields, each)) for each in json.loads(text)])
    if found is None:
        raise ValueError('{!r} is no log of causes'.format(text))
    return found
