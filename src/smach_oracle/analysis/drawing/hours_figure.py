"""Continuous operation over its hours: attempts and questions, what was needed, learned rates."""

import json
from typing import Any, Dict, List, Mapping, Sequence, Tuple

from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from smach_oracle.oracle.decision.failure_rate import FailureRate, make_estimator
from smach_oracle.oracle.settings.settings import StateSettings

from ..comparison import SECONDS_PER_HOUR
from ..figure import BLACK, BLUE, VERMILLION
from ..lasting.causes_log import causes_in
from ..sweep_figure import GREEN
from ..trial_counter import PERSON_NEEDED
from ..trial_rows import LOST, TrialRow
from .looks import Happened, legend_above, panels
from .titles import tasks_of, title_of

USUAL = StateSettings()
HEIGHT_IN = 5.6
CURVES: Tuple[Tuple[str, str, str, Happened], ...] = (
    ('oracle recovered', BLUE, '-', lambda row: row.recovered),
    (PERSON_NEEDED, VERMILLION, '--', lambda row: row.intervened),
    ('not a true success', BLACK, ':', lambda row: not row.succeeded),
)
LIGHT = {'glare': '#F0E442', 'dim_light': '#BBBBBB'}  # behind the events of trials with such light
PALE = 0.6
LOST_LOOK: Mapping[str, Any] = dict(color=BLACK, marker='x', linestyle='none', markersize=5)
MOST_STATES = 6  # whose rates are drawn, those that failed most
# colours of Okabe and Ito's palette that are left, and dashes, so that lines are told apart
RATE_LOOKS = (
    (BLUE, '-'),
    (VERMILLION, '--'),
    (GREEN, '-.'),
    (BLACK, ':'),
    ('#CC79A7', (0, (5, 1, 1, 1, 1, 1))),
    ('#E69F00', (0, (2, 1))),
)


def draw_hours(rows: Sequence[TrialRow]) -> Figure:
    """Draw a column of panels for each task, over the hours of its run."""
    known = [row for row in rows if row.hour is not None]
    tasks = tasks_of(known)
    figure, made = panels(
        [title_of(task) for task in tasks],
        HEIGHT_IN,
        rows=3,
        margins=dict(left=0.09, bottom=0.08, top=0.91, hspace=0.42),
    )
    for column, task in enumerate(tasks):
        mine = sorted((row for row in known if row.task == task), key=lambda row: row.seed)
        events, needed, rates = (line[column] for line in made)
        _draw_events(events, mine)
        _draw_needed(needed, mine)
        _draw_rates(rates, mine)
        for axes in (events, needed, rates):
            axes.set_xlim(0, max(_hours(mine)[-1], 1e-3))
        rates.set_xlabel('Hour of the run')
        if column == 0:
            for axes, label in (
                (events, 'Attempts (up),\nquestions (down)'),
                (needed, 'Trials so far'),
                (rates, 'Learned failure rate'),
            ):
                axes.set_ylabel(label)
    legend_above(figure, made[1][0], (), _beside(known))
    return figure


def _beside(rows: Sequence[TrialRow]) -> List[Tuple[Any, str]]:
    """Return the legend of what stands in the upper panels, as far as it is there."""
    lights = {kind for row in rows for kind in lights_of(row)}
    found: List[Tuple[Any, str]] = [
        (Patch(color=colour, alpha=PALE, linewidth=0), kind.replace('_', ' '))
        for kind, colour in LIGHT.items()
        if kind in lights
    ]
    if any(row.ending == LOST for row in rows):
        found.append((Line2D([], [], **LOST_LOOK), 'lost'))
    return found


def lights_of(row: TrialRow) -> List[str]:
    """Return the kinds of light of LIGHT that came in a trial. Some come after its end.

    A row without a log has those that it lists.
    """
    kinds = (
        [cause.kind for cause in causes_in(row.cause_log) if cause.began_s is not None]
        if row.cause_log
        else row.causes.split()
    )
    return [kind for kind in LIGHT if kind in kinds]


def _hours(rows: Sequence[TrialRow]) -> List[float]:
    return [row.hour or 0.0 for row in rows]


def _draw_events(axes: Any, rows: Sequence[TrialRow]) -> None:
    """Draw a stem for each trial, and behind it what light it had."""
    hours = _hours(rows)
    widths = [later - hour for hour, later in zip(hours, hours[1:])] + [0.0]
    for row, hour, width in zip(rows, hours, widths):
        for kind in lights_of(row):
            axes.axvspan(hour, hour + width, color=LIGHT[kind], linewidth=0, alpha=PALE)
    axes.vlines(hours, 0, [row.attempts for row in rows], color=BLUE, linewidth=0.9)
    axes.vlines(hours, [-row.questions for row in rows], 0, color=VERMILLION, linewidth=0.9)
    lost = [row.hour for row in rows if row.ending == LOST]
    axes.plot(lost, [0] * len(lost), label='lost', **LOST_LOOK)
    axes.axhline(0, color=BLACK, linewidth=0.5)
    axes.yaxis.set_major_locator(MaxNLocator(nbins=5, integer=True))


def _draw_needed(axes: Any, rows: Sequence[TrialRow]) -> None:
    """Draw in how many trials so far something happened."""
    for label, colour, dashes, happened in CURVES:
        counts = [sum(map(happened, rows[: number + 1])) for number in range(len(rows))]
        axes.step(
            [0.0, *_hours(rows)],
            [0, *counts],
            where='post',
            color=colour,
            linestyle=dashes,
            linewidth=1.1,
            label=label,
        )
    axes.set_ylim(bottom=0)
    axes.yaxis.set_major_locator(MaxNLocator(nbins=5, integer=True))


def _draw_rates(axes: Any, rows: Sequence[TrialRow]) -> None:
    """Draw the rates of the states that failed most. A small shift keeps equal ones apart."""
    series = learned_rates(rows)
    ranked = sorted(series, key=lambda state: (-sum(rate for _, rate in series[state]), state))
    for number, state in enumerate(ranked[:MOST_STATES]):
        colour, dashes = RATE_LOOKS[number % len(RATE_LOOKS)]
        hours, rates = zip(*series[state])
        axes.step(
            hours,
            [rate + 0.006 * number for rate in rates],
            where='post',
            color=colour,
            linestyle=dashes,
            linewidth=1.0,
            label=state,
        )
    axes.set_ylim(0, 1.04)
    axes.legend(
        loc='lower left',
        bbox_to_anchor=(0, 1.0),
        ncol=3,
        frameon=False,
        fontsize=6,
        borderaxespad=0.0,
        handlelength=2.2,
        columnspacing=0.8,
        handletextpad=0.4,
    )


def learned_rates(rows: Sequence[TrialRow]) -> Dict[str, List[Tuple[float, float]]]:
    """Return the failure rate that the oracle goes by after each trial, as (hour of its end, rate).

    States that never failed are left out. A row of an older version lacks memory and prior: then
    they are those of the settings' defaults.
    """
    series: Dict[str, List[Tuple[float, float]]] = {}
    failed = set()
    for row in rows:
        for path, states in (json.loads(row.learned) if row.learned else {}).items():
            for state, learned in states.items():
                name = '{}/{}'.format(path, state) if path else state
                series.setdefault(name, []).append((_end(row), _rate(row, learned)))
                if learned.get('failures'):
                    failed.add(name)
    return {name: series[name] for name in series if name in failed}


def _end(row: TrialRow) -> float:
    return (row.hour or 0.0) + (row.sim_s or 0.0) / SECONDS_PER_HOUR


def _rate(row: TrialRow, learned: Mapping[str, Any]) -> float:
    estimator = make_estimator(
        learned.get('estimator', FailureRate.kind),
        USUAL.memory if row.memory is None else row.memory,
        USUAL.prior if row.prior is None else row.prior,
    )
    estimator.restore(learned)
    return estimator.rate
