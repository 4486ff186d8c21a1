"""Tables of the sweeps: the difference to restart over lasting causes, questions over memories."""

import math
from typing import Dict, List, Sequence

from ..comparison import by_variant, groups_of
from ..intervals import paired_difference
from ..pairing import DEFAULT, RESTART, paired_counts, trend_of
from ..trial_rows import TrialRow
from .cause_tables import share_text
from .markdown import titled
from .policies import memory_of, policy_of
from .titles import tasks_of, title_of


def format_sweeps(kind: str, rows: Sequence[TrialRow]) -> str:
    """Return the tables of a kind of figure beyond those of its groups. '' means it has none."""
    tables = {'persistence': _differences, 'memory': _trends}.get(kind)
    return '\n'.join(tables(rows)) if tables else ''


def _differences(rows: Sequence[TrialRow]) -> List[str]:
    """Tell how often the default needed a person, less how often restart did, at each share."""
    lines: Dict[str, List[List[str]]] = {}
    for (task, share, *_), mine in groups_of(rows).items():
        variants = by_variant(mine)
        if share is None or DEFAULT not in variants or RESTART not in variants:
            continue
        counts = paired_counts(variants[DEFAULT], variants[RESTART], lambda row: row.intervened)
        pairs = sum(counts)
        if pairs:
            first, second = (
                (counts.both + alone) / pairs for alone in (counts.first_alone, counts.second_alone)
            )
            lines.setdefault(task, []).append(
                [
                    '{:.0%}'.format(share),
                    str(pairs),
                    '{:.1%}'.format(first),
                    '{:.1%}'.format(second),
                    '{:.1%} ({:.1%} to {:.1%})'.format(first - second, *paired_difference(*counts)),
                ]
            )
    heads = ['causes that last', 'pairs', 'default', 'restart', 'default less restart']
    return [
        titled(
            title_of(task) + ': person needed, paired by seed',
            heads,
            lines[task],
            [
                "In parentheses: Newcombe's 95% interval of a paired difference (Stat. Med. 17, "
                '1998, p. 2635, method 10).'
            ],
        )
        for task in tasks_of(rows)
        if task in lines
    ]


def _trends(rows: Sequence[TrialRow]) -> List[str]:
    """Tell the share of trials with a question for each memory, and test the trend."""
    texts = []
    for task in tasks_of(rows):
        for policy in dict.fromkeys(policy_of(row) for row in rows):
            mine = [row for row in rows if (row.task, policy_of(row)) == (task, policy)]
            memories = sorted({memory for memory in map(memory_of, mine) if memory})
            if len(memories) > 1:
                texts.append(
                    _trend(
                        '{}: {} over its memory'.format(title_of(task), policy),
                        [row for row in mine if memory_of(row)],
                        memories,
                    )
                )
    return texts


def _trend(title: str, rows: Sequence[TrialRow], memories: Sequence[float]) -> str:
    by_memory = {memory: [row for row in rows if memory_of(row) == memory] for memory in memories}
    lines = []
    for memory, mine in by_memory.items():
        asked = sum(row.questions > 0 for row in mine)
        lines.append(['{:g}'.format(memory), str(len(mine)), share_text(asked, len(mine))])
    trend = trend_of(
        rows, lambda row: math.log(memory_of(row) or 1.0), lambda row: row.questions > 0
    )
    told = (
        'No two trials of a seed differ.'
        if trend is None
        else (
            'Trend over N: z = {:.2f} (above 0: the share grows), p = {:.2g}, two-sided.'.format(
                *trend
            )
        )
    )
    return titled(
        title,
        ['memory N', 'trials', 'with a question'],
        lines,
        [
            told
            + " Mantel's extension test over log N, with a stratum for each seed (J. Am. Stat. "
            "Assoc. 58, 1963): Cochran and Armitage's for paired trials. It does not know that "
            'trials of a replicate depend on each other.'
        ],
    )
