"""Trials by what they are compared by, and in what else such groups differ. Pure."""

import datetime
import os
from typing import Any, Callable, Dict, List, Mapping, NamedTuple, Sequence, Tuple

from ..counting.trial_summary import TrialSummary
from ..variants import KINDS, VariantTrials

NOT_RECORDED = 'not recorded'
_WITH_ORACLE = dict(KINDS)
_SHOWN = 3  # values of a group in a warning


class TrialGroup(NamedTuple):
    """The trials of one experiment that have one value of what is compared."""

    experiment: str
    name: str
    trials: Tuple[TrialSummary, ...]

    @property
    def as_variant(self) -> VariantTrials:
        """Return it as trials whose events can be counted."""
        return VariantTrials(self.experiment, self.name, None, {}, self.trials)


def day_of(trial: TrialSummary) -> str:
    """Return the day on which a trial began, in UTC."""
    try:
        began = datetime.datetime.fromtimestamp(trial.start_time, datetime.timezone.utc)
    except (OverflowError, OSError, ValueError):
        return NOT_RECORDED
    return began.strftime('%Y-%m-%d')


def _origin(key: str) -> Callable[[TrialSummary], str]:
    return lambda trial: str(dict(trial.origin).get(key, '')) or NOT_RECORDED


def _oracle(trial: TrialSummary) -> str:
    return _WITH_ORACLE[trial.recovers]


def _settings(trial: TrialSummary) -> str:
    if not trial.recovers:
        return _oracle(trial)
    told = ', '.join('{} {}'.format(*each) for each in trial.settings)
    digest = dict(trial.origin).get('settings')
    return '{} ({})'.format(told, digest) if digest else told or NOT_RECORDED


# what a trial has one of, by the words of an option and of a warning
VALUES: Mapping[str, Callable[[TrialSummary], str]] = {
    'node': lambda trial: trial.node or NOT_RECORDED,
    'host': _origin('host'),
    'version': _origin('version'),
    'settings': _settings,
    'script': _origin('script'),
    'day': day_of,
    'engine': _origin('engine'),
    'python': _origin('python'),
    'ros': _origin('ros'),
    'rule of failures': lambda trial: str(trial.rule),
}
BY = ('folder', 'node', 'host', 'version', 'settings', 'script', 'day')


def groups_by(by: str, trials: Sequence[TrialSummary], places: Sequence[str]) -> List[TrialGroup]:
    """Return the trials of each experiment in groups, both in alphabetical order.

    :param by: one of BY.
    :param places: the folders that were read. Where there are several, they are the groups.
    """
    value = _folder_in(places) if by == 'folder' else VALUES[by]
    found: Dict[Tuple[str, str], List[TrialSummary]] = {}
    for trial in trials:
        found.setdefault((trial.experiment, value(trial)), []).append(trial)
    groups = [TrialGroup(*key, tuple(found[key])) for key in sorted(found)]
    return _named_by_what_differs(groups) if by == 'settings' else groups


def _folder_in(places: Sequence[str]) -> Callable[[TrialSummary], str]:
    """Name a trial by the place that it was read from, or by its folder where there is one place.

    Names are from the folder on that is around all places.
    """
    real = sorted({os.path.realpath(place) for place in places}, key=len, reverse=True)
    around = real[0] if len(real) == 1 else os.path.commonpath(real)

    def folder(trial: TrialSummary) -> str:
        if not trial.bags:
            return NOT_RECORDED
        if len(real) == 1:
            return os.path.relpath(trial.replicate, around)
        path = trial.bags[0]
        inside = [each for each in real if path == each or path.startswith(each + os.sep)]
        return os.path.relpath(inside[0] if inside else trial.replicate, around)

    return folder


def _named_by_what_differs(groups: Sequence[TrialGroup]) -> List[TrialGroup]:
    """Name groups of other settings by those that differ between the groups."""
    named: List[TrialGroup] = []
    for group in groups:
        others = [each.trials[0] for each in groups if each.experiment == group.experiment]
        with_oracle = [dict(each.settings) for each in others if each.recovers]
        keys = sorted({key for each in with_oracle for key in each})
        differing = [key for key in keys if len({repr(each.get(key)) for each in with_oracle}) > 1]
        first = group.trials[0]
        own = dict(first.settings) if first.recovers else {}
        words = ['{} {}'.format(key, own.get(key, 'unknown')) for key in differing if own]
        name = ', '.join([_oracle(first), *words])
        taken = [each.name for each in named if each.experiment == group.experiment]
        if name in taken:  # settings of single states differ
            name = '{}, settings {}'.format(name, dict(first.origin).get('settings', len(taken)))
        named.append(group._replace(name=name))
    return named


def other_differences(by: str, first: TrialGroup, second: TrialGroup) -> List[str]:
    """Return what two groups differ in beyond that by which they are compared, a clause each."""
    found = []
    for what, value in VALUES.items():
        if what == by or (by == 'settings' and what == 'rule of failures'):
            continue
        one, other = ({value(trial) for trial in group.trials} for group in (first, second))
        if one != other:
            found.append(_told(what, one, other))
    return found


def _told(what: str, one: Any, other: Any) -> str:
    if what == 'settings':  # too long to be told
        return 'settings (--by settings tells them apart)'
    return '{} ({} and {})'.format(what, _some(one), _some(other))


def _some(values: Any) -> str:
    shown = sorted(values)[:_SHOWN]
    return ', '.join(shown) + (', ...' if len(values) > _SHOWN else '')
