"""All that a report shows, counted."""

import os
from collections import Counter
from typing import Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

from smach_oracle.oracle.records.events import Event
from smach_oracle.oracle.settings.failure_rule import FailureRule

from ..by_state.follower import states_of
from ..by_state.state_counts import StatesOfTrials
from ..causes import CauseRow, cause_rows
from ..comparing.groups import NOT_RECORDED, TrialGroup
from ..comparing.report import PairOfGroups, compared
from ..counting.trial_summary import TrialSummary
from ..graphs.container_graph import ContainerGraph
from ..trials import Trials
from ..variants import VariantCounts, VariantTrials, count_variant, find_variants, time_series
from .drawn import RateChart, Survival, rate_charts, survivals
from .events_again import EventsInTurn
from .failure_ways import (
    FailureWays,
    PreconditionCounts,
    add_preconditions,
    failure_ways,
    precondition_counts,
)
from .inline_svg import time_series_svg
from .learned_rates import LearnedRates, learned_rates
from .machine_graphs import ContainerDrawing, Drawer, SeenContainers, graphs_of, jumps_of
from .notices import warnings_about
from .survival import hours_of, stretches
from .taken import add_taken, nothing_taken

MOST_FIGURES = 12  # of each kind, of an experiment
MOST_RATES = 12  # states of one oracle

EventsOf = Mapping[str, Sequence[Event]]  # by trial id


class Span(NamedTuple):
    """The facts about some trials that name what was read."""

    trials: int
    bags: int
    first: float  # s since the epoch: when the first one began
    last: float  # when the last one ended
    hours: float  # in which they ran
    hosts: List[Tuple[str, int]]
    versions: List[Tuple[str, int]]


class Figure(NamedTuple):
    """A figure that is there as SVG."""

    caption: str
    svg: str


class RatesOfFolder(NamedTuple):
    """What one oracle has learned in the trials of a folder."""

    folder: str
    rates: LearnedRates
    charts: List[RateChart]


class VariantPart(NamedTuple):
    """One variant of an experiment."""

    variant: VariantTrials
    counts: VariantCounts
    hours: float
    states: StatesOfTrials
    ways: FailureWays
    preconditions: PreconditionCounts
    survivals: List[Survival]
    rates: List[RatesOfFolder]
    rates_left_out: int  # folders
    graphs: List[ContainerDrawing]
    jumps: List[Tuple[str, str, str, int]]


class Chapter(NamedTuple):
    """One experiment."""

    experiment: str
    parts: List[VariantPart]
    figures: List[Figure]
    figures_left_out: int
    causes: List[CauseRow]
    problem: str  # why graphs are tables, '' where they are drawn


class Comparison(NamedTuple):
    """The groups of --by."""

    by: str
    groups: List[VariantCounts]
    pairs: List[PairOfGroups]


class ReportContents(NamedTuple):
    """All of it."""

    places: Sequence[str]
    span: Span
    found: Trials
    variants: List[VariantCounts]
    chapters: List[Chapter]
    comparison: Optional[Comparison]
    warnings: List[str]


class ReportOptions(NamedTuple):
    """The options that a report obeys."""

    places: Sequence[str]
    rule: Optional[FailureRule] = None
    by: str = ''
    x_axis: str = 'trials'


def report_on(
    found: Trials,
    events: EventsOf,
    asked: ReportOptions,
    groups: Optional[Sequence[TrialGroup]] = None,
) -> ReportContents:
    """Count all that a report shows."""
    drawer = Drawer()
    variants = find_variants(found.trials)
    chapters = [
        _chapter(experiment, variants, found.trials, events, asked, drawer, at)
        for at, experiment in enumerate(dict.fromkeys(each.experiment for each in variants))
    ]
    counts = [part.counts for chapter in chapters for part in chapter.parts]
    rates = [each.rates for c in chapters for part in c.parts for each in part.rates]
    problem = next((chapter.problem for chapter in chapters if chapter.problem), '')
    return ReportContents(
        asked.places,
        _span(found.trials),
        found,
        counts,
        chapters,
        None if groups is None else _comparison(asked.by, groups),
        warnings_about(found, counts, rates, problem),
    )


def _span(trials: Sequence[TrialSummary]) -> Span:
    return Span(
        len(trials),
        len({bag for trial in trials for bag in trial.bags}),
        min(trial.start_time for trial in trials),
        max(trial.start_time + trial.duration_s for trial in trials),
        sum(map(hours_of, trials)),
        _origins(trials, 'host'),
        _origins(trials, 'version'),
    )


def _origins(trials: Sequence[TrialSummary], key: str) -> List[Tuple[str, int]]:
    counts = Counter(dict(trial.origin).get(key, '') or NOT_RECORDED for trial in trials)
    return sorted(counts.items(), key=lambda each: (-each[1], each[0]))


def _comparison(by: str, groups: Sequence[TrialGroup]) -> Comparison:
    counts = [count_variant(group.as_variant) for group in groups]
    return Comparison(by, counts, compared(by, groups))


def _chapter(
    experiment: str,
    variants: Sequence[VariantTrials],
    trials: Sequence[TrialSummary],
    events: EventsOf,
    asked: ReportOptions,
    drawer: Drawer,
    number: int,
) -> Chapter:
    mine = [trial for trial in trials if trial.experiment == experiment]
    own = [each for each in variants if each.experiment == experiment]
    drawer.problem = ''
    seen, gathered = _gather(mine, own, events, asked.rule)
    graphs = graphs_of(mine, seen)
    parts = [_part(each, what, events, asked, graphs, drawer) for each, what in zip(own, gathered)]
    series = time_series(mine)
    return Chapter(
        experiment,
        parts,
        [
            Figure(
                ', '.join(words) or 'all trials',
                time_series_svg(chosen, asked.x_axis, 'f{}-{}'.format(number, at)),
            )
            for at, (words, chosen) in enumerate(series[:MOST_FIGURES])
        ],
        max(0, len(series) - MOST_FIGURES),
        cause_rows(mine),
        drawer.problem,
    )


class _Gathered:
    """The counts of the events of a variant's trials."""

    def __init__(self) -> None:
        self.states = StatesOfTrials()
        self.ways = FailureWays()
        self.preconditions: PreconditionCounts = {}
        self.taken = nothing_taken()

    def add(self, events: Sequence[Event], rule: Optional[FailureRule]) -> None:
        self.states.add(states_of(events, rule))
        self.ways.add(failure_ways(events, rule))
        add_preconditions(self.preconditions, precondition_counts(events))
        add_taken(self.taken, events)


def _gather(
    trials: Sequence[TrialSummary],
    variants: Sequence[VariantTrials],
    events: EventsOf,
    rule: Optional[FailureRule],
) -> Tuple[SeenContainers, List[_Gathered]]:
    """Go through the events of an experiment's trials once. Return what is of each variant."""
    seen, gathered = SeenContainers(), [_Gathered() for _ in variants]
    of_trial = {
        trial.trial_id: what for each, what in zip(variants, gathered) for trial in each.trials
    }
    for trial in trials:
        told = events[trial.trial_id]
        seen.add(told)
        of_trial[trial.trial_id].add(told, rule)
    return seen, gathered


def _part(
    variant: VariantTrials,
    gathered: _Gathered,
    events: EventsOf,
    asked: ReportOptions,
    graphs: Sequence[ContainerGraph],
    drawer: Drawer,
) -> VariantPart:
    paths = [graph.path for graph in graphs]
    rates = [] if variant.recovers is False else _rates(variant, events, asked.places)
    return VariantPart(
        variant,
        count_variant(variant),
        sum(map(hours_of, variant.trials)),
        gathered.states,
        gathered.ways,
        gathered.preconditions,
        survivals(stretches(variant.trials)),
        rates[:MOST_FIGURES],
        max(0, len(rates) - MOST_FIGURES),
        [drawer.draw(graph, gathered.taken, gathered.states, paths) for graph in graphs],
        jumps_of(gathered.taken),
    )


def _rates(variant: VariantTrials, events: EventsOf, places: Sequence[str]) -> List[RatesOfFolder]:
    folders: Dict[str, List[str]] = {}
    for trial in variant.trials:
        folders.setdefault(trial.replicate, []).append(trial.trial_id)
    found = []
    for folder in sorted(folders):
        rates = learned_rates(EventsInTurn(events, folders[folder]), variant.settings)
        if rates is not None:
            charts = rate_charts(rates, MOST_RATES)
            found.append(RatesOfFolder(_below(folder, places), rates, charts))
    return found


def _below(folder: str, places: Sequence[str]) -> str:
    """Return a folder from the one on that is around all places."""
    try:
        around = os.path.commonpath([os.path.realpath(place) for place in places])
    except ValueError:  # none, or no names of files
        return folder
    inside = folder.startswith(around.rstrip(os.sep) + os.sep)
    return os.path.relpath(folder, around) if inside else folder
