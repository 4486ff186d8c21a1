"""The figures of an experiment as a Markdown table: a line for each variant."""
from typing import List, Optional, Sequence

from ..comparison import Costs, Group, Share, costs_of, groups_of, shares_of
from ..pairing import HINDSIGHT, hindsight
from ..trial_rows import TrialRow
from .looks import title_of, variants_of

SHARES = ('true success', 'interventions', 'recovered', 'with attempts', 'lost or hung')
COSTS = ('attempts', 'questions', 'questions_per_hour', 'expert_s', 'expert_s_per_hour',
         'wrong_objects', 'damage', 'damage_done', 'completion_s', 'trials_between', 'hours_between')
HEADS = ('attempts a trial', 'questions a trial', 'questions an hour', 'expert s a trial',
         'expert s an hour', 'wrong object', 'damage for each completed task',
         'damage in a completed task', 'completion, s',
         'trials between interventions', 'hours between interventions')


def format_tables(rows: Sequence[TrialRow]) -> str:
    """Return a table for each task and share of lasting causes."""
    texts = []
    for group, mine in groups_of(rows).items():
        heads = ['variant', 'trials', *SHARES, *HEADS]
        lines = ['**{}**'.format(_titled(group)), '', _line(heads), _line(['---'] * len(heads))]
        names = variants_of(mine)
        for name in names:
            lines.append(_variant(name, [row for row in mine if row.variant == name]))
        best = hindsight(mine) if len(names) > 1 else []
        if best:
            lines.append(_variant(HINDSIGHT, best))
        texts.append('\n'.join(lines) + '\n')
    return '\n'.join(texts)


def _titled(group: Group) -> str:
    task, share = group
    return title_of(task) + ('' if share is None else ', {:.0%} of the causes last'.format(share))


def _variant(name: str, rows: Sequence[TrialRow]) -> str:
    shares = {share.name: share for share in shares_of(rows)}
    costs: Costs = costs_of(rows)
    return _line([name.replace('_', ' '), str(len(rows)),
                  *(_percent(shares[each]) for each in SHARES),
                  *(_number(getattr(costs, each)) for each in COSTS)])


def _percent(share: Share) -> str:
    return '{:.1%} ({:.0%} to {:.0%})'.format(share.share, *share.interval)


def _number(value: Optional[float]) -> str:
    return '-' if value is None else '{:.3g}'.format(value)


def _line(cells: List[str]) -> str:
    return '| {} |'.format(' | '.join(cells))
