"""Writes a report as one page of HTML: no other file, no network, no script.

All that comes from bags is foreign text. Jinja2 escapes it, and `shown` takes what a page must not
have: control characters, marks that turn the direction of what follows, and endless lines.
"""

import datetime
from pathlib import Path
from typing import Any, Optional, Sequence

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from smach_oracle.oracle.records.short_text import seen, shortened

from ..by_state.rows import costs_of
from ..by_state.text import ANSWER_WORDS, answers_of
from ..comparing.groups import TrialGroup
from ..intervals import wilson_interval
from ..table import over_replicates
from ..trials import Trials
from . import charts
from .contents import EventsOf, ReportContents, ReportOptions, report_on
from .machine_graphs import colour_of

TEMPLATES = Path(__file__).parent / 'templates'
LONGEST = 400  # letters of a text that are shown


def write_report(
    path: str,
    found: Trials,
    events: EventsOf,
    asked: ReportOptions,
    groups: Optional[Sequence[TrialGroup]] = None,
) -> None:
    """Write the report. The same bags give the same file.

    :param events: of each trial, in the order of their numbers.
    :param groups: of --by, where that was asked for.
    :raises OSError: where it cannot be written.
    """
    text = page_of(report_on(found, events, asked, groups))
    with open(path, 'w', encoding='utf-8', newline='\n') as target:
        target.write(text)


def page_of(report: ReportContents) -> str:
    """Return the page."""
    environment = Environment(
        loader=FileSystemLoader(str(TEMPLATES)),
        autoescape=True,
        undefined=StrictUndefined,
        finalize=shown,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(
        percent=percent,
        bounds=bounds,
        when=when,
        duration=duration,
        short=shortened,
        counted=counted,
        often=often,
        below=below,
        colour=colour_of,
        two=two,
    )
    environment.globals.update(
        answer_words=ANSWER_WORDS,
        answers_of=answers_of,
        charts=charts,
        costs_of=costs_of,
        over_replicates=over_replicates,
        wilson=wilson_interval,
    )
    return environment.get_template('report.html').render(report=report)


def shown(value: Any) -> Any:
    """Return what a page shows of a value. Markup, which the templates make, stays as it is."""
    if value is None:
        return '–'
    if isinstance(value, str) and not hasattr(value, '__html__'):
        return shortened(seen(value), LONGEST)
    return value


def percent(share: float) -> str:
    """Return a share in percent, e.g. "8.0%"."""
    return '{:.1f}%'.format(100 * share)


def bounds(interval: Sequence[float]) -> str:
    """Return an interval of shares, e.g. "4.6 to 13.5%"."""
    return '{:.1f} to {:.1f}%'.format(*(100 * each for each in interval))


def when(time_s: float) -> str:
    """Return a time in UTC. `time_s`: since the epoch."""
    try:
        told = datetime.datetime.fromtimestamp(time_s, datetime.timezone.utc)
    except (OverflowError, OSError, ValueError):
        return 'not known'
    return told.strftime('%Y-%m-%d %H:%M')


def duration(hours: float) -> str:
    """Return a duration in the unit that suits it."""
    if hours >= 2:
        return '{:.1f} h'.format(hours)
    return '{:.1f} min'.format(60 * hours) if hours >= 1 / 30 else '{:.1f} s'.format(3600 * hours)


def two(value: Optional[float]) -> Optional[str]:
    """Return a number with two digits behind the point. None is not known."""
    return None if value is None else '{:.2f}'.format(value)


def often(number: int) -> str:
    """Return how often something happened, in words."""
    return 'once' if number == 1 else '{} times'.format(number)


def below(path: str, top: str) -> str:
    """Return a path below the top machine. That of the machine itself stays."""
    begin = top + '/'
    return path[len(begin) :] if path.startswith(begin) else path


def counted(number: int, one: str, several: str) -> str:
    """Return a number with its noun."""
    return '{} {}'.format(number, one if number == 1 else several)
