"""What a reader of a report has to know before the numbers. Pure."""

from collections import Counter
from typing import List, Sequence

from ..comparing.groups import NOT_RECORDED
from ..counting.trial_summary import TrialSummary
from ..table import rules_of
from ..trial_counter import TrialEnding
from ..trials import Trials
from ..variants import VariantCounts
from .learned_rates import LearnedRates


def warnings_about(
    found: Trials,
    variants: Sequence[VariantCounts],
    rates: Sequence[LearnedRates],
    problem: str,
) -> List[str]:
    """Return a warning a line.

    :param problem: why graphs are tables, '' where they are drawn.
    """
    return [
        *_about_bags(found),
        *(line for variant in variants for line in _about_variant(variant)),
        *_about_judges(variants),
        *_about_ends(found.trials),
        *_about_origin(found.trials),
        *_about_rates(rates),
        *_about_graphs(problem),
    ]


def _about_bags(found: Trials) -> List[str]:
    if not found.skipped:
        return []
    return [
        '{} skipped, since they cannot be used. Their trials are in no number. The last page '
        'names them with the reasons.'.format(counted(len(found.skipped), 'bag was', 'bags were'))
    ]


def _about_variant(variant: VariantCounts) -> List[str]:
    name, lines = '{}, {}'.format(variant.experiment, variant.name), []
    if variant.lost_events:
        lines.append(
            '{}: {} missing in {} (gaps in their numbering). The counts are lower bounds.'.format(
                name,
                counted(variant.lost_events, 'event is', 'events are'),
                counted(variant.trials_with_gaps, 'trial', 'trials'),
            )
        )
    if 0 < variant.truth_known < variant.trials:
        lines.append(
            '{}: the judge saw {} of {} trials. Its rows are of those.'.format(
                name, variant.truth_known, variant.trials
            )
        )
    if variant.resumed:
        lines.append(
            '{}: {} resumed after the program was stopped. It was down for {:.0f} s in all.'.format(
                name, counted(variant.resumed, 'trial was', 'trials were'), variant.down_s
            )
        )
    return lines


def _about_judges(variants: Sequence[VariantCounts]) -> List[str]:
    unjudged = sum(variant.unjudged for variant in variants)
    if not unjudged:
        return []
    return [
        'No judge saw {} that ended with neither a failure nor a question. How many of them are '
        'false successes is not known. So "person needed" is a lower bound, and the time without '
        'a person an upper one.'.format(counted(unjudged, 'trial', 'trials'))
    ]


def _about_ends(trials: Sequence[TrialSummary]) -> List[str]:
    lines = []
    unknown = sum(trial.recovers is None for trial in trials)
    if unknown:
        lines.append(
            'Nothing says of {} whether the oracle was at work: the variant is unknown.'.format(
                counted(unknown, 'trial', 'trials')
            )
        )
    unfinished = sum(trial.ending is TrialEnding.UNFINISHED for trial in trials)
    if unfinished:
        lines.append(
            'The record of {} ends before the trial does.'.format(
                counted(unfinished, 'trial', 'trials')
            )
        )
    others = sorted({trial.outcome for trial in trials if trial.ending is TrialEnding.OTHER})
    if others:
        lines.append(
            'Nothing says whether these ends of a trial are successes: {}.'.format(
                ', '.join(others)
            )
        )
    return lines + rules_of(trials)


def _about_origin(trials: Sequence[TrialSummary]) -> List[str]:
    lines = []
    for key, words in (('version', 'versions of smach_oracle'), ('host', 'hosts')):
        counts = Counter(dict(trial.origin).get(key, '') or NOT_RECORDED for trial in trials)
        if len(counts) > 1:
            lines.append(
                'The trials ran on several {}: {}.'.format(
                    words, ', '.join('{} ({})'.format(*each) for each in sorted(counts.items()))
                )
            )
    return lines


def _about_rates(rates: Sequence[LearnedRates]) -> List[str]:
    lines = []
    if any(each.has_gaps for each in rates):
        lines.append(
            'The learned rates of some trials are known after failures alone: the record does not '
            'tell those at the end, and the settings do not reproduce the recorded ones.'
        )
    if any(each.settings_differ for each in rates):
        lines.append(
            'Some states have classes that do not follow from the bounds of their machine: they '
            'may have settings of their own. The bands are those of the machine.'
        )
    return lines


def _about_graphs(problem: str) -> List[str]:
    if not problem:
        return []
    return [
        'Some graphs are tables here, since they were not laid out ({}). dot, which does so, is in '
        'the package graphviz.'.format(problem)
    ]


def counted(number: int, one: str, several: str) -> str:
    """Return a number with its noun."""
    return '{} {}'.format(number, one if number == 1 else several)
