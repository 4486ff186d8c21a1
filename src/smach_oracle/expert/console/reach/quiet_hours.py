"""The hours in which a person is not called, by this machine's local time. Pure."""

import re
from datetime import datetime, timedelta
from typing import Iterable, List, NamedTuple, Tuple

from smach_oracle.oracle.errors import SettingsError

DAYS = ('mon', 'tue', 'wed', 'thu', 'fri', 'sat', 'sun')
ALLOWED = '"22:00-07:00", "sat", or both, as in "sun 00:00-12:00"'
_DAY_MINUTES = 24 * 60
_SPAN = re.compile(r'(?:(?P<day>[a-z]{3})\b)? *(?:(\d\d):([0-5]\d)-(\d\d):([0-5]\d))?')


class _QuietSpan(NamedTuple):
    """From a minute of a day on, for some minutes."""

    days: Tuple[int, ...]  # on which it begins
    begin: int
    minutes: int


class QuietHours:
    """Spans of time, each on one day of the week or on every day."""

    def __init__(self, name: str, texts: Iterable[str]) -> None:
        """:raises SettingsError: naming the setting and the text that is no span."""
        self._spans: List[_QuietSpan] = [_span(name, text) for text in texts]

    def covers(self, moment: datetime) -> bool:
        """Whether a moment is in one of them. A span over midnight belongs to the day before it."""
        return any(_covers(span, moment) for span in self._spans)


def _covers(span: _QuietSpan, moment: datetime) -> bool:
    minute = moment.hour * 60 + moment.minute
    yesterday = (moment - timedelta(days=1)).weekday()
    return (moment.weekday() in span.days and 0 <= minute - span.begin < span.minutes) or (
        yesterday in span.days and 0 <= minute + _DAY_MINUTES - span.begin < span.minutes
    )


def _span(name: str, text: str) -> _QuietSpan:
    found = _SPAN.fullmatch(text.strip().lower())
    if not found or not found.group() or found.group('day') not in (None, *DAYS):
        raise SettingsError(name, text, ALLOWED)
    day = found.group('day')
    days = (DAYS.index(day),) if day else tuple(range(7))
    if found.group(2) is None:
        return _QuietSpan(days, 0, _DAY_MINUTES)
    hours = [int(part) for part in found.groups()[1:]]
    begin, end = 60 * hours[0] + hours[1], 60 * hours[2] + hours[3]
    if begin >= _DAY_MINUTES or end > _DAY_MINUTES or begin == end:
        raise SettingsError(name, text, ALLOWED)
    return _QuietSpan(days, begin, end - begin if end > begin else end + _DAY_MINUTES - begin)
