"""The figures of an experiment as Markdown tables: a line for each figure, a column a variant."""

from typing import Dict, List, Optional, Sequence, Tuple

from ..comparison import (
    Costs,
    Group,
    Share,
    by_variant,
    common_completion,
    costs_of,
    groups_of,
    shares_of,
    with_hindsight,
)
from ..pairing import HINDSIGHT, paired_counts, pairs_to_test
from ..trial_counter import EXPERT_ANSWERED, PERSON_NEEDED
from ..trial_rows import TrialRow
from .cause_tables import by_cause, by_class, by_log
from .markdown import titled
from .titles import tasks_of, title_of

SHARES = (
    'true success',
    PERSON_NEEDED,
    'a question asked',
    EXPERT_ANSWERED,
    'recovered',
    'with attempts',
    'false success',
    'lost or hung',
)
OTHER_END = 'other end'  # there only where a variant has some
OVER_REPLICATES = ('true success', PERSON_NEEDED, 'a question asked', 'recovered')
# of Costs, and what it is called
COSTS: Tuple[Tuple[str, str], ...] = (
    ('wrong_objects', 'trials with a wrong object'),
    ('damage', 'damage for each completed task'),
    ('damage_done', 'damage in a completed task'),
    ('attempts', 'attempts a trial'),
    ('questions', 'questions a trial'),
    ('questions_per_hour', 'questions a robot hour'),
    ('expert_s', 'expert s a trial'),
    ('expert_s_per_hour', 'expert s a robot hour'),
    ('completion_s', 's to completion, median'),
    ('trials_between', 'trials per person needed'),
    ('hours_between', 'robot hours per person needed'),
)
SUMMARY = ('true success', PERSON_NEEDED, 'a question asked', 'recovered')
# of Costs, in the summary
SUMMED_UP = ('damage', 'expert_s', 'completion_s')
COMPARING = ('main', 'persistence', 'extra')
SAME_SEEDS = ('true success', PERSON_NEEDED, 'a question asked')


def format_tables(rows: Sequence[TrialRow], kind: str = 'main') -> str:
    """Return the tables of each task, and of each choice of its causes.

    :param kind: of the figure. Variants are compared in those of COMPARING.
    """
    texts: List[str] = []
    groups = groups_of(rows)
    for task in tasks_of(rows):
        for group in (each for each in groups if each.task == task):
            title, variants = named(group), by_variant(groups[group])
            texts += [_summary(title, variants), _main(title, variants)]
            if kind in COMPARING:
                texts += _tests(title, variants) + _same_seeds(title, groups[group])
                texts += by_class(title, variants)
                texts += by_cause(title, variants) if kind in ('main', 'extra') else []
                texts += by_log(title, variants)
    return '\n'.join(texts)


def named(group: Group) -> str:
    """Return what a task and its kinds of causes are called in a title."""
    return title_of(group.task) + group.told


def _summary(title: str, variants: Dict[str, List[TrialRow]]) -> str:
    """Tell the figures that matter most, a line for each variant."""
    lines = []
    for name, rows in variants.items():
        shares, costs = {share.name: share for share in shares_of(rows)}, costs_of(rows)
        lines.append(
            [
                name.replace('_', ' '),
                str(len(rows)),
                *(percent(shares[each]) for each in SUMMARY),
                *(number(getattr(costs, each)) for each in SUMMED_UP),
            ]
        )
    return titled(
        title + ', in short',
        ['variant', 'trials', *SUMMARY, *(dict(COSTS)[each] for each in SUMMED_UP)],
        lines,
    )


def _main(title: str, variants: Dict[str, List[TrialRow]]) -> str:
    shares = [{share.name: share for share in shares_of(rows)} for rows in variants.values()]
    costs: List[Costs] = [costs_of(rows) for rows in variants.values()]
    lines = [['trials', *(str(len(rows)) for rows in variants.values())]]
    for name in SHARES + ((OTHER_END,) if any(OTHER_END in each for each in shares) else ()):
        lines.append([name, *(percent(each[name]) if name in each else '0' for each in shares)])
        if name in OVER_REPLICATES and any(each[name].over_replicates for each in shares):
            lines.append([name + ', replicates', *(over_replicates(each[name]) for each in shares)])
    for name, head in COSTS:
        lines.append([head, *(number(getattr(each, name)) for each in costs)])
        if name == 'completion_s':
            lines += _completion(variants)
    return titled(
        title,
        _heads(variants),
        lines,
        [
            'In parentheses: 95% Wilson intervals over trials.',
            *(
                [
                    'Replicates: the smallest and the largest share of a replicate. In '
                    "parentheses: Student's 95% interval of their mean."
                ]
                if any(line[0].endswith('replicates') for line in lines)
                else []
            ),
            'A robot hour is one of world time in which a trial runs. '
            + (
                'The time between trials counts, too: the world goes on.'
                if any(row.hour is not None for rows in variants.values() for row in rows)
                else 'The time between trials does not count.'
            ),
        ],
    )


def _completion(variants: Dict[str, List[TrialRow]]) -> List[List[str]]:
    seeds, medians = common_completion(variants)
    head = 's to completion, median, on the {} seeds that bare, default and restart completed'
    return (
        [[head.format(seeds), *(number(medians.get(name)) for name in variants)]] if seeds else []
    )


def _tests(title: str, variants: Dict[str, List[TrialRow]]) -> List[str]:
    """Tell McNemar's exact test of the trials that needed a person."""
    lines = []
    for first, second in pairs_to_test(list(variants)):
        counts = paired_counts(variants[first], variants[second], lambda row: row.intervened)
        if sum(counts):
            lines.append(
                [
                    '{} against {}'.format(first, second).replace('_', ' '),
                    *map(str, (sum(counts), *counts)),
                    '{:.2g}'.format(counts.p_value),
                ]
            )
    heads = ['', 'pairs', 'both', 'the first alone', 'the second alone', 'neither', 'p']
    return (
        [
            titled(
                title + ': person needed, paired by seed',
                heads,
                lines,
                [
                    "p: McNemar's exact test, two-sided, on the pairs that differ, without a "
                    'correction for their number.'
                ],
            )
        ]
        if lines
        else []
    )


def _same_seeds(title: str, rows: Sequence[TrialRow]) -> List[str]:
    """Tell the bound beside each variant on the same seeds."""
    found = with_hindsight(rows)
    if not found:
        return []
    shares = [{share.name: share for share in shares_of(mine)} for mine in found.values()]
    return [
        titled(
            '{}: the {} seeds that all variants ran'.format(title, len(found[HINDSIGHT])),
            _heads(found),
            [[name, *(percent(each[name]) for each in shares)] for name in SAME_SEEDS],
            [
                'Hindsight is the best that any variant did on each of these seeds: a bound, '
                'and no variant.'
            ],
        )
    ]


def _heads(variants: Dict[str, List[TrialRow]]) -> List[str]:
    return ['', *(name.replace('_', ' ') for name in variants)]


def percent(share: Share) -> str:
    """Return a share with its interval, in percent."""
    return '{:.1%} ({:.0%} to {:.0%})'.format(share.share, *share.interval)


def over_replicates(share: Share) -> str:
    """Return the smallest and largest share of a replicate, and their mean's interval."""
    over, mean = share.over_replicates, share.of_mean
    return (
        '-'
        if over is None or mean is None
        else '{:.1%} to {:.1%} ({:.0%} to {:.0%})'.format(*over, *mean)
    )


def number(value: Optional[float]) -> str:
    """Return a figure. '-' means there is none."""
    return '-' if value is None else '{:.3g}'.format(value)
