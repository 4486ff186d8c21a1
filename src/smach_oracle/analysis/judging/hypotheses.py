"""The hypotheses of the fifth freeze, tested on rows. doc/protocol.md says them in words."""

import itertools
from typing import Callable, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

from smach_oracle.oracle.decision.ways import Prices

from ..pairing import BARE, DEFAULT, RESTART, PairedCounts, paired_counts
from ..trial_rows import TrialRow
from .account import harm_in
from .paired_tests import (
    ONE_SIDED,
    costs_less,
    less_than_a_part,
    needs_more,
    not_worse,
    power_where_equal,
    ratio_interval,
    tango_interval,
)

MENU, LEARNED, RANDOM = (
    'one_line:' + name for name in ('escalating', 'learned', 'any_way')
)  # names of variants
WORLDS = ('pick_and_place', 'drink_retrieval')
PART, MARGIN, HARM_MARGIN = 0.5, 0.03, 0.02
SECONDS = 60.0  # of a minute
PRICES = Prices()  # those of the setting `cost`
Arms = Mapping[str, Sequence[TrialRow]]  # rows by variant


class Finding(NamedTuple):
    """The result of a test in one world, or over both."""

    p_value: float
    text: str

    @property
    def passed(self) -> bool:
        """Whether the null hypothesis is rejected."""
        return self.p_value <= ONE_SIDED


class Hypothesis(NamedTuple):
    """A hypothesis about two variants."""

    name: str
    first: str
    second: str
    words: str
    test: Callable[[Sequence[TrialRow], Sequence[TrialRow]], Finding]


def cost_of(row: TrialRow, prices: Prices = PRICES) -> float:
    """Return what a trial costs, in minutes of the robot."""
    return (
        prices.robot_minute * (row.sim_s or 0.0) / SECONDS
        + prices.expert_minute * (row.expert_s or 0.0) / SECONDS
        + prices.harm * (row.damage or 0)
        + (0.0 if row.succeeded else prices.lost_trial)
    )


def was_harmful(row: TrialRow) -> bool:
    """Whether something came to harm. A lost trial counts as one without harm."""
    return (row.damage or 0) > 0


def harmed_unasked(row: TrialRow) -> bool:
    """Whether something came to harm before a person was asked: the oracle alone was at work."""
    if not was_harmful(row):
        return False
    seen = [each.seen_s for each in harm_in(row.harmed)] if row.harmed else []
    times = [second for second in seen if second is not None]
    return row.asked_s is None or (bool(times) and min(times) < row.asked_s)


def _needs_a_person(row: TrialRow) -> bool:
    return row.intervened


def _half_as_often(first: Sequence[TrialRow], second: Sequence[TrialRow]) -> Finding:
    counts = paired_counts(first, second, _needs_a_person)
    low, high = ratio_interval(counts)
    text = '{}; ratio {:.2f} (95% {:.2f} to {:.2f})'.format(
        _shares(counts), _ratio(counts), low, high
    )
    return Finding(less_than_a_part(counts, PART), text)


def _ratio(counts: PairedCounts) -> float:
    second = counts.both + counts.second_alone
    return (counts.both + counts.first_alone) / second if second else float('nan')


def _shares(counts: PairedCounts) -> str:
    pairs = sum(counts)
    return '{} and {} of {}'.format(
        counts.both + counts.first_alone, counts.both + counts.second_alone, pairs
    )


def _within(margin: float, happened: Callable[[TrialRow], bool]) -> Callable[..., Finding]:
    def test(first: Sequence[TrialRow], second: Sequence[TrialRow]) -> Finding:
        counts = paired_counts(first, second, happened)
        alone = counts.first_alone, counts.second_alone
        if not sum(counts):
            return Finding(1.0, 'no pairs')
        low, high = tango_interval(*alone, sum(counts))
        text = '{}; difference {:+.1%} (95% {:+.1%} to {:+.1%})'.format(
            _shares(counts), (alone[0] - alone[1]) / sum(counts), low, high
        )
        return Finding(not_worse(counts, margin), text)

    return test


def _cheaper(first: Sequence[TrialRow], second: Sequence[TrialRow]) -> Finding:
    others = {row.pair: row for row in second}
    pairs = [(row, others[row.pair]) for row in first if row.pair in others]
    failing = [pair for pair in pairs if any(row.failures or not row.succeeded for row in pair)]
    found = costs_less(
        [cost_of(row) for row, _ in failing], [cost_of(other) for _, other in failing]
    )
    text = 'on {} failing seeds {:+.2f} minutes of the robot{}'.format(
        found.pairs, found.mean, '' if found.exact else ' (signs drawn)'
    )
    return Finding(found.p_value, text)


HYPOTHESES = (
    Hypothesis('H1', MENU, RESTART, 'needs a person less than half as often as', _half_as_often),
    Hypothesis(
        'H2',
        MENU,
        DEFAULT,
        'needs a person not 3 points oftener than',
        _within(MARGIN, _needs_a_person),
    ),
    Hypothesis('H3', LEARNED, RANDOM, 'costs less on failing seeds than', _cheaper),
    Hypothesis(
        'H4',
        LEARNED,
        MENU,
        'needs a person not 3 points oftener than',
        _within(MARGIN, _needs_a_person),
    ),
)
HARM = _within(HARM_MARGIN, was_harmful)


def arms_of(rows: Sequence[TrialRow]) -> Dict[str, Dict[str, List[TrialRow]]]:
    """Return the rows of the hypotheses by world and variant.

    Rows of a world that goes on, or of other causes, are of another experiment.
    """
    found: Dict[str, Dict[str, List[TrialRow]]] = {world: {} for world in WORLDS}
    for row in rows:
        usual = row.hour is None and row.lasting_share is None and not row.extra_causes
        if row.task in found and usual:
            found[row.task].setdefault(row.variant, []).append(row)
    return found


def findings(rows: Sequence[TrialRow], hypothesis: Hypothesis) -> Dict[str, Finding]:
    """Return what is found in each world that has both variants."""
    return {
        world: hypothesis.test(arms[hypothesis.first], arms[hypothesis.second])
        for world, arms in arms_of(rows).items()
        if hypothesis.first in arms and hypothesis.second in arms
    }


def harm_found(rows: Sequence[TrialRow], variant: str, beside: str) -> Optional[Finding]:
    """Return how often something is harmed under two variants, over both worlds.

    None where one of them has not been run.
    """
    arms = arms_of(rows).values()
    ours = [row for each in arms for row in each.get(variant, ())]
    others = [row for each in arms for row in each.get(beside, ())]
    return HARM(ours, others) if ours and others else None


def verdicts(rows: Sequence[TrialRow]) -> List[str]:
    """Return the verdicts as lines, none where no hypothesis has rows of both of its variants.

    A hypothesis holds where it passes in both worlds and all before it hold.
    """
    lines: List[str] = []
    passed: Dict[str, bool] = {}
    for each in HYPOTHESES:
        found = findings(rows, each)
        if not found:
            continue
        passed[each.name] = len(found) == len(WORLDS) and all(one.passed for one in found.values())
        before = [one.name for one in HYPOTHESES[: HYPOTHESES.index(each)]]
        holds = passed[each.name] and all(passed.get(name) for name in before)
        lines.append(
            '  {}: {} {} {}: {}'.format(
                each.name,
                each.first,
                each.words,
                each.second,
                'holds'
                if holds
                else 'passes, but one before it does not'
                if passed[each.name]
                else 'is not shown'
                if len(found) == len(WORLDS)
                else 'one world is missing',
            )
        )
        lines += [
            '    {:<16} {}; p = {:.3g}'.format(world, one.text, one.p_value)
            for world, one in found.items()
        ]
    if lines:
        lines += _harm_lines(rows, passed) + _extension(rows)
    return lines


def undecided(rows: Sequence[TrialRow]) -> List[str]:
    """Return a line for each task whose rows decide no hypothesis, whatever variants they have."""
    others = sorted({row.task for row in rows} - set(WORLDS))
    return ['  {}: decides no hypothesis, and is told as it is'.format(task) for task in others]


def _harm_lines(rows: Sequence[TrialRow], passed: Dict[str, bool]) -> List[str]:
    lines = []
    for variant, beside in itertools.product((MENU, LEARNED), (BARE, DEFAULT)):
        found = harm_found(rows, variant, beside)
        if found is not None:
            lines.append(
                '  harm: in trials of {} something is harmed not 2 points oftener than under {}: '
                '{}'.format(variant, beside, 'holds' if found.passed else 'is not shown')
            )
            lines.append('    {:<16} {}; p = {:.3g}'.format('both', found.text, found.p_value))
            lines.append('    {:<16} {}'.format('', _before_a_person(rows, variant, beside)))
            if (variant, beside) == (MENU, BARE) and {'H1', 'H2'} <= set(passed):
                passes = found.passed and passed['H1'] and passed['H2']
                lines.append(
                    '  the default: {}'.format(
                        '{} by one line passes H1, H2 and harm'.format(variant.split(':')[1])
                        if passes
                        else 'prose stays, as H1, H2 and harm do not all pass'
                    )
                )
    return lines


def _before_a_person(rows: Sequence[TrialRow], *variants: str) -> str:
    """Say how often something came to harm before a person was asked."""
    arms = arms_of(rows).values()
    counts = [
        sum(harmed_unasked(row) for each in arms for row in each.get(name, ())) for name in variants
    ]
    return 'before a person was asked: {} beside {}'.format(*counts)


def _extension(rows: Sequence[TrialRow]) -> List[str]:
    """Say whether H2 and H4 are to be extended: by the pairs that differ, and not by which way."""
    lines = []
    for world, (name, counts) in _differing(rows):
        differ, pairs = counts.first_alone + counts.second_alone, sum(counts)
        lines.append(
            '  {} {:<16} {} of {} pairs differ, power where both are equal {:.2f}: {}'.format(
                name,
                world,
                differ,
                pairs,
                power_where_equal(differ, pairs, MARGIN),
                'extend' if needs_more(differ, pairs, MARGIN) else 'enough',
            )
        )
    return lines


def _differing(rows: Sequence[TrialRow]) -> List[Tuple[str, Tuple[str, PairedCounts]]]:
    found = []
    for each in HYPOTHESES:
        if each.name in ('H2', 'H4'):
            for world, arms in arms_of(rows).items():
                if each.first in arms and each.second in arms:
                    counts = paired_counts(arms[each.first], arms[each.second], _needs_a_person)
                    found.append((world, (each.name, counts)))
    return found
