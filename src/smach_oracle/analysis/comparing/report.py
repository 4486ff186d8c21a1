"""The comparison of groups as text and as plain data."""

import itertools
import textwrap
from typing import Any, Dict, List, NamedTuple, Sequence, Tuple

from ..table import group_table, variant_data
from ..variants import VariantCounts, count_variant
from .group_tests import ShareTest, pairing_of, share_tests
from .groups import TrialGroup, other_differences

MOST_GROUPS = 6  # of an experiment, each two of which are tested. With more, the first and each


class PairOfGroups(NamedTuple):
    """Two groups of one experiment, and what their trials say."""

    first: TrialGroup
    second: TrialGroup
    pairs: int  # trials that are the same in both. 0: they are not paired
    paired_by: str  # one of PAIRED_BY
    tests: List[ShareTest]
    differ_in: List[str]


def compared(by: str, groups: Sequence[TrialGroup]) -> List[PairOfGroups]:
    """Return the groups of each experiment two by two."""
    found = []
    for _, mine in itertools.groupby(groups, key=lambda group: group.experiment):
        for first, second in _pairs(list(mine)):
            paired_by, pairs = pairing_of(first, second)
            found.append(
                PairOfGroups(
                    first,
                    second,
                    len(pairs),
                    paired_by,
                    share_tests(first, second),
                    other_differences(by, first, second),
                )
            )
    return found


def _pairs(groups: Sequence[TrialGroup]) -> List[Tuple[TrialGroup, TrialGroup]]:
    if len(groups) > MOST_GROUPS:
        return [(groups[0], each) for each in groups[1:]]
    return list(itertools.combinations(groups, 2))


def format_groups(by: str, groups: Sequence[TrialGroup]) -> str:
    """Return the table of the groups, and the tests of each two."""
    lines = ['', 'Compared by {}'.format(by), *group_table(_counts(groups), by.capitalize())]
    pairs = compared(by, groups)
    for pair in pairs:
        lines += _pair(pair)
    if not pairs:
        lines += ['', '  There is one group in each experiment: nothing to test.']
    elif len(pairs) > 1:
        lines += ['', '  p values are not corrected for their number.']
    return '\n'.join(lines) + '\n'


def _counts(groups: Sequence[TrialGroup]) -> List[VariantCounts]:
    return [count_variant(group.as_variant) for group in groups]


def _pair(pair: PairOfGroups) -> List[str]:
    first, second, pairs = pair.first, pair.second, pair.pairs
    left = len(first.trials) + len(second.trials) - 2 * pairs
    how = "not paired: Fisher's exact test, and Newcombe's interval"
    if pairs:
        how = "{} pairs by {}{}: McNemar's exact test, and Newcombe's interval".format(
            pairs, pair.paired_by, ', {} trials left out'.format(left) if left else ''
        )
    lines = [
        '',
        '{}: {} against {}'.format(first.experiment, first.name, second.name),
        '  ' + how,
        '  {:<21}{:>16}{:>16}{:>13}   {:<19}{:>9}'.format(
            '', 'first', 'second', 'difference', '95% interval', 'p'
        ),
    ]
    for test in pair.tests:
        lines.append(
            '  {:<21}{:>16}{:>16}{:>+12.1f}%   {:<19}{:>9.3g}'.format(
                test.name + (' (least)' if test.is_bound else ''),
                _share(test.first, test.first_of),
                _share(test.second, test.second_of),
                100 * test.difference,
                '{:+.1f} to {:+.1f}%'.format(*(100 * bound for bound in test.interval)),
                test.p_value,
            )
        )
    if any(test.is_bound for test in pair.tests):
        lines.append('  (least): false successes are not known, as no judge saw some of the trials')
    if pair.differ_in:
        lines += textwrap.wrap(
            'Warning: these groups differ in more: {}.'.format('; '.join(pair.differ_in)),
            98,
            initial_indent='  ',
            subsequent_indent='    ',
        )
    return lines


def _share(number: int, of: int) -> str:
    return '{}/{} ({:.1f}%)'.format(number, of, 100 * number / of)


def groups_data(by: str, groups: Sequence[TrialGroup]) -> Dict[str, Any]:
    """Return all of it as plain data, for JSON."""
    pairs = compared(by, groups)
    return {
        'by': by,
        'groups': [dict(variant_data(counts), group=counts.name) for counts in _counts(groups)],
        'tests': [
            dict(
                test._asdict(),
                experiment=pair.first.experiment,
                first_group=pair.first.name,
                second_group=pair.second.name,
            )
            for pair in pairs
            for test in pair.tests
        ],
        'warnings': [
            {
                'experiment': pair.first.experiment,
                'first_group': pair.first.name,
                'second_group': pair.second.name,
                'differ_in': pair.differ_in,
            }
            for pair in pairs
            if pair.differ_in
        ],
    }
