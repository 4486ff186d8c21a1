"""The figures of an experiment as Markdown tables: a line for each figure, a column a variant."""
from typing import Dict, List, Optional, Sequence, Tuple

from ..comparison import (
    Costs,
    Group,
    Share,
    by_variant,
    costs_of,
    groups_of,
    shares_of,
    with_hindsight,
)
from ..pairing import HINDSIGHT
from ..trial_rows import TrialRow
from .looks import title_of
from .markdown import titled

SHARES = ('true success', 'interventions', 'a question asked', 'recovered', 'with attempts',
          'false success', 'lost or hung')
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
    ('trials_between', 'trials between interventions'),
    ('hours_between', 'robot hours between interventions'))
SAME_SEEDS = ('true success', 'interventions', 'a question asked')


def format_tables(rows: Sequence[TrialRow]) -> str:
    """Return the tables of each task and share of lasting causes."""
    texts: List[str] = []
    for group, mine in groups_of(rows).items():
        texts.append(_main(named(group), by_variant(mine)))
        texts += _same_seeds(named(group), mine)
    return '\n'.join(texts)


def named(group: Group) -> str:
    """Return what a task and a share of lasting causes are called in a title."""
    task, share = group
    return title_of(task) + ('' if share is None else ', {:.0%} of the causes last'.format(share))


def _main(title: str, variants: Dict[str, List[TrialRow]]) -> str:
    shares = [{share.name: share for share in shares_of(rows)} for rows in variants.values()]
    costs: List[Costs] = [costs_of(rows) for rows in variants.values()]
    lines = [['trials', *(str(len(rows)) for rows in variants.values())]]
    for name in SHARES:
        lines.append([name, *(percent(each[name]) for each in shares)])
    for name, head in COSTS:
        lines.append([head, *(number(getattr(each, name)) for each in costs)])
    return titled(title, _heads(variants), lines)


def _same_seeds(title: str, rows: Sequence[TrialRow]) -> List[str]:
    """Tell the bound beside each variant on the same seeds."""
    found = with_hindsight(rows)
    if not found:
        return []
    shares = [{share.name: share for share in shares_of(mine)} for mine in found.values()]
    return [titled('{}: the {} seeds that all variants ran'.format(title, len(found[HINDSIGHT])),
                   _heads(found), [[name, *(percent(each[name]) for each in shares)]
                                   for name in SAME_SEEDS],
                   ['Hindsight is the best that any variant did on each of these seeds: a bound, '
                    'and no variant.'])]


def _heads(variants: Dict[str, List[TrialRow]]) -> List[str]:
    return ['', *(name.replace('_', ' ') for name in variants)]


def percent(share: Share) -> str:
    """Return a share with its interval, in percent."""
    return '{:.1%} ({:.0%} to {:.0%})'.format(share.share, *share.interval)


def number(value: Optional[float]) -> str:
    """Return a figure. '-' means there is none."""
    return '-' if value is None else '{:.3g}'.format(value)
