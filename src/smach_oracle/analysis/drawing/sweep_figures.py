"""Figures of the sweeps: over the share of lasting causes, and over the memory."""

import math
from typing import Callable, Dict, List, Optional, Sequence, Tuple

from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from ..trial_rows import TrialRow
from .looks import Happened, Percent, legend_above, look_of, panels
from .policies import memory_of, policy_of
from .titles import tasks_of, title_of, variants_of

Shown = Tuple[str, Happened]
NEEDED: Shown = ('Person needed (% of trials)', lambda row: row.intervened)
QUESTIONS: Shown = ('With a question (% of trials)', lambda row: row.questions > 0)
SUCCESS: Shown = ('True success (% of trials)', lambda row: row.succeeded)
HEIGHT_IN = 4.0
ASIDE = 2.5  # percent of causes, from one variant's marker to the next
ASIDE_FACTOR = 1.04  # of a memory, likewise


def draw_persistence(rows: Sequence[TrialRow]) -> Figure:
    """Draw where a person was needed above true success, a panel for each task."""
    return _draw(
        rows,
        (NEEDED, SUCCESS),
        lambda row: row.variant,
        lambda row: None if row.lasting_share is None else 100 * row.lasting_share,
        'Share of causes that last (%)',
        lambda x, place: x + ASIDE * place,
        False,
    )


def draw_memory(rows: Sequence[TrialRow]) -> Figure:
    """Draw trials with a question above true success, over the memory N."""
    return _draw(
        rows,
        (QUESTIONS, SUCCESS),
        policy_of,
        memory_of,
        'Memory N (results of a state)',
        lambda x, place: x * ASIDE_FACTOR**place,
        True,
    )


def _draw(
    rows: Sequence[TrialRow],
    shown: Sequence[Shown],
    series_of: Callable[[TrialRow], str],
    x_of: Callable[[TrialRow], Optional[float]],
    label: str,
    aside: Callable[[float, float], float],
    logarithmic: bool,
) -> Figure:
    """Draw shares with their intervals. Series stand a little beside each other."""
    tasks = tasks_of(rows)
    figure, made = panels(
        [title_of(task) for task in tasks],
        HEIGHT_IN,
        rows=2,
        margins=dict(bottom=0.10, top=0.89, hspace=0.12),
    )
    series = variants_of([row._replace(variant=series_of(row)) for row in rows])
    highest = [_highest(rows, happened, series_of, x_of) for _, happened in shown]
    for column, task in enumerate(tasks):
        points = _points([row for row in rows if row.task == task], series_of, x_of)
        for line, (name, happened) in enumerate(shown):
            axes = made[line][column]
            for number, each in enumerate(series):
                found = sorted(
                    (x, Percent(chosen, happened))
                    for (of, x), chosen in points.items()
                    if of == each
                )
                colour, marker, dashes = look_of(each)
                place = number - (len(series) - 1) / 2
                axes.errorbar(
                    [aside(x, place) for x, _ in found],
                    [one.share for _, one in found],
                    yerr=list(zip(*(one.reach for _, one in found))) or None,
                    color=colour,
                    marker=marker,
                    linestyle=dashes,
                    markersize=3.5,
                    linewidth=1.1,
                    elinewidth=0.8,
                    capsize=2,
                    label=each,
                    clip_on=False,
                )
            if logarithmic:
                axes.set_xscale('log')
            ticks = sorted({x for _, x in points})
            axes.xaxis.set_major_locator(FixedLocator(ticks))
            axes.xaxis.set_minor_locator(NullLocator())
            axes.set_xticklabels(['{:g}'.format(x) for x in ticks] if line else [])
            axes.set_ylim(0, highest[line])
            if column == 0:
                axes.set_ylabel(name)
        made[-1][column].set_xlabel(label)
    legend_above(figure, made[0][0])
    return figure


def _highest(
    rows: Sequence[TrialRow],
    happened: Happened,
    series_of: Callable[[TrialRow], str],
    x_of: Callable[[TrialRow], Optional[float]],
) -> float:
    """Return the end of an axis (%): the tens above all intervals, alike for all tasks."""
    ends = [
        Percent(chosen, happened).interval[1]
        for task in tasks_of(rows)
        for chosen in _points([row for row in rows if row.task == task], series_of, x_of).values()
    ]
    return min(100.0, 10.0 * math.ceil(max(ends, default=100.0) / 10.0))


def _points(
    rows: Sequence[TrialRow],
    series_of: Callable[[TrialRow], str],
    x_of: Callable[[TrialRow], Optional[float]],
) -> Dict[Tuple[str, float], List[TrialRow]]:
    """Return the rows of each point, by series and x. Rows without an x are left out."""
    points: Dict[Tuple[str, float], List[TrialRow]] = {}
    for row in rows:
        x = x_of(row)
        if x is not None:
            points.setdefault((series_of(row), x), []).append(row)
    return points
