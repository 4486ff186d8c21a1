"""Charts of survival and of learned rates, ready to be drawn. Pure."""

from typing import List, NamedTuple, Optional, Sequence, Tuple

from .charts import RIGHT, WIDTH, Axes, Corner, Tick, stepped
from .learned_rates import Bands, LearnedRates, StateRates
from .survival import (
    Duration,
    PersonFree,
    SurvivalStep,
    kaplan_meier,
    median_of,
)

# units of time: from how many hours on, and how many are in an hour
_UNITS = ((2.0, 'hours', 1.0), (1 / 30, 'minutes', 60.0), (0.0, 'seconds', 3600.0))
_NAMES = 78.0  # room for the names of zones


class Zone(NamedTuple):
    """A part of a chart between two shares, and what its name is."""

    y: float
    height: float
    name: str
    look: str  # class of the style sheet


class Chart(NamedTuple):
    """A chart of shares. Lengths are in units of its view box."""

    x_ticks: List[Tick]
    y_ticks: List[Tick]
    x_name: str
    zones: List[Zone]
    area: str  # path of a band, '' for none
    lines: List[Tuple[str, str]]  # path, and class of the style sheet
    marks: List[Corner]  # places, not lengths
    label: str  # for those who cannot see it
    right: float = WIDTH - RIGHT  # where the axes end


class Survival(NamedTuple):
    """The survival of a variant in one unit."""

    unit: str
    stretches: int
    ended: int  # by a person
    median: Optional[float]
    steps: List[SurvivalStep]
    chart: Chart

    @property
    def median_in_words(self) -> str:
        """Return what half of the stretches do."""
        if self.median is None:
            return 'More than half go on beyond all {} that were seen'.format(self.unit)
        unit = self.unit[:-1] if self.median == 1 else self.unit
        return 'At most half go on beyond {:.3g} {}'.format(self.median, unit)


def survivals(found: Sequence[PersonFree]) -> List[Survival]:
    """Return the survival in trials, and in the time of the robot."""
    if not found:
        return []
    by_trials = [Duration(float(each.trials), each.is_ended) for each in found]
    longest = max(each.hours for each in found)
    unit, per_hour = next((name, number) for least, name, number in _UNITS if longest >= least)
    by_time = [Duration(each.hours * per_hour, each.is_ended) for each in found]
    result = [_survival('trials', by_trials, True)]
    if longest > 0:
        result.append(_survival(unit, by_time, False))
    return result


def _survival(unit: str, durations: Sequence[Duration], whole: bool) -> Survival:
    steps = kaplan_meier(durations)
    last = max(each.length for each in durations)
    axes = Axes(0.0, last)
    lines = [
        stepped([(step.length, share(step)) for step in steps], (0.0, 1.0), last)
        for share in (_share, _low, _high)
    ]
    ended = sum(each.is_ended for each in durations)
    marks = []
    for length in sorted({each.length for each in durations if not each.is_ended}):
        before = [step.share for step in steps if step.length <= length]
        marks.append((axes.x(length), axes.y(before[-1] if before else 1.0)))
    label = 'Share of {} stretches that go on beyond a number of {}'.format(len(durations), unit)
    chart = Chart(
        axes.x_ticks(whole),
        axes.y_ticks(),
        '{} without a person'.format(unit.capitalize()),
        [],
        axes.area(lines[1], lines[2]) if steps else '',
        [
            (axes.line(lines[1]), 'bound'),
            (axes.line(lines[2]), 'bound'),
            (axes.line(lines[0]), 'curve'),
        ]
        if steps
        else [(axes.line(lines[0]), 'curve')],
        marks,
        label,
    )
    return Survival(unit, len(durations), ended, median_of(steps), steps, chart)


def _share(step: SurvivalStep) -> float:
    return step.share


def _low(step: SurvivalStep) -> float:
    return step.interval[0]


def _high(step: SurvivalStep) -> float:
    return step.interval[1]


class RateChart(NamedTuple):
    """The learned rate of one state."""

    state: str
    failures: int
    first: float
    last: float
    most: float
    last_class: str  # '' where the bounds are not known
    chart: Chart


def rate_charts(rates: LearnedRates, most: int) -> List[RateChart]:
    """Return the charts of the states that failed most."""
    return [_rate_chart(each, rates.trials, rates.bands) for each in rates.states[:most]]


def _rate_chart(state: StateRates, trials: int, bands: Optional[Bands]) -> RateChart:
    axes = Axes(1.0, float(max(2, trials)), WIDTH - (_NAMES if bands else RIGHT))
    points = [(float(number), rate) for number, rate in state.points]
    corners = stepped(points[1:], points[0], float(trials))
    rates = [rate for _, rate in points]
    last_class = bands.class_of(rates[-1]) if bands else ''
    label = 'Failure rate of {} after each of {} trials: {:.0%} at first, {:.0%} at last'.format(
        state.state, trials, rates[0], rates[-1]
    )
    return RateChart(
        state.state,
        state.failures,
        rates[0],
        rates[-1],
        max(rates),
        last_class,
        Chart(
            axes.x_ticks(True),
            axes.y_ticks(),
            'Trial',
            _zones(axes, bands),
            '',
            [(axes.line(corners), 'curve')],
            [(axes.x(points[0][0]), axes.y(rates[0]))] if len(points) == 1 else [],
            label,
            axes.right,
        ),
    )


def _zones(axes: Axes, bands: Optional[Bands]) -> List[Zone]:
    if bands is None:
        return []
    limits = [0.0, bands.moderate_from, max(bands.moderate_from, bands.high_from), 1.0]
    zones = []
    for name, low, high in zip(('LOW', 'MODERATE', 'HIGH'), limits, limits[1:]):
        if high > low:
            above = axes.y(high)
            zones.append(Zone(above, round(axes.y(low) - above, 2), name, name.lower()))
    return zones
