"""The shifts of a day, by this machine's local time. Pure."""

import re
from datetime import datetime, timedelta

from smach_oracle.oracle.errors import SettingsError

DEFAULT_SHIFTS = '06:00 14:00 22:00'
_TIME = re.compile(r'([01]\d|2[0-3]):([0-5]\d)')


class Shifts:
    """The times of a day at which a shift begins."""

    def __init__(self, text: str = DEFAULT_SHIFTS) -> None:
        """:raises SettingsError: where the text has no times, or something else."""
        found = [_TIME.fullmatch(each) for each in text.split()]
        if not found or not all(found):
            raise SettingsError('~shifts', text, 'times at which shifts begin: ' + DEFAULT_SHIFTS)
        self._begins = sorted({(int(each.group(1)), int(each.group(2))) for each in found if each})

    def begin_of(self, at: float) -> float:
        """Return when the shift of a moment began. Both in s since the epoch."""
        moment = datetime.fromtimestamp(at)
        begun = [each for each in self._begins if each <= (moment.hour, moment.minute)]
        day = moment if begun else moment - timedelta(days=1)
        hour, minute = (begun or self._begins)[-1]
        return day.replace(hour=hour, minute=minute, second=0, microsecond=0).timestamp()
