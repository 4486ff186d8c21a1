"""The paper's Table I from the summaries of trials, with confidence intervals (definitions: doc/statistics.md)."""
import csv
import json
import math
from typing import Any, Callable, Dict, IO, List, NamedTuple, Optional, Sequence, Tuple

from .bag_events import Skipped
from .trials import Ending, TrialSummary

Z_95 = 1.959963984540054  # two-sided 95% quantile of the normal distribution
ARMS = ((True, 'with oracle'), (False, 'without oracle'), (None, 'arm unknown'))


class Count(NamedTuple):
    """How many trials of a group something happened in, and how often."""

    name: str
    trials: int
    share: float  # of the group's trials, 0 to 1
    interval: Tuple[float, float]  # 95% Wilson score interval of the share
    events: Optional[int]  # None where it happens at most once a trial


class Group(NamedTuple):
    """The trials of one experiment in one arm."""

    experiment: str
    arm: str
    runs: int
    counts: Tuple[Count, ...]
    trials_with_gaps: int
    lost_events: int

    def of(self, name: str) -> Count:
        """The count of that name."""
        return next(item for item in self.counts if item.name == name)


RECOVERIES = 'oracle recoveries'
QUESTIONS = 'questions to the expert'
ANSWERED = 'answered'
NOT_ANSWERED = 'not answered'
_BY_EVENTS: Tuple[Tuple[str, Callable[[TrialSummary], int]], ...] = (
    ('failures of states', lambda trial: trial.failures),
    (RECOVERIES, lambda trial: trial.recoveries),
    (QUESTIONS, lambda trial: trial.questions),
    (ANSWERED, lambda trial: trial.answered),
    (NOT_ANSWERED, lambda trial: trial.questions - trial.answered),
)
_ENDINGS = {Ending.SUCCESS: 'ended in success', Ending.FAILURE: 'ended in failure', Ending.PREEMPTED: 'preempted',
            Ending.UNFINISHED: 'unfinished'}


def wilson_interval(successes: int, runs: int, z: float = Z_95) -> Tuple[float, float]:
    """Wilson score interval of a share (E. B. Wilson, J. Am. Stat. Assoc. 22, 1927); (0, 1) where there are no runs.

    Raises ValueError unless 0 <= successes <= runs.
    """
    if not 0 <= successes <= runs:
        raise ValueError('successes: {} is not allowed; allowed: 0 to {}'.format(successes, runs))
    if runs == 0:
        return 0.0, 1.0
    share = successes / runs
    centre = share + z * z / (2 * runs)
    half = z * math.sqrt(share * (1 - share) / runs + z * z / (4 * runs * runs))
    scale = 1 + z * z / runs
    low = 0.0 if successes == 0 else (centre - half) / scale
    return low, 1.0 if successes == runs else (centre + half) / scale


def make_groups(trials: Sequence[TrialSummary]) -> List[Group]:
    """Count, by experiment (in alphabetical order) and arm."""
    groups = []
    for experiment in sorted({trial.experiment for trial in trials}):
        for recovers, arm in ARMS:
            chosen = [trial for trial in trials if trial.experiment == experiment and trial.recovers is recovers]
            if chosen:
                groups.append(_group(experiment, arm, chosen))
    return groups


def _group(experiment: str, arm: str, trials: Sequence[TrialSummary]) -> Group:
    runs = len(trials)
    counts = [_count(name, sum(1 for trial in trials if number(trial)), runs, sum(map(number, trials)))
              for name, number in _BY_EVENTS]
    counts += [_count(name, sum(1 for trial in trials if trial.ending is ending), runs)
               for ending, name in _ENDINGS.items()]
    return Group(experiment, arm, runs, tuple(counts), sum(1 for trial in trials if trial.lost_events),
                 sum(trial.lost_events for trial in trials))


def _count(name: str, trials: int, runs: int, events: Optional[int] = None) -> Count:
    return Count(name, trials, trials / runs, wilson_interval(trials, runs), events)


def format_text(groups: Sequence[Group]) -> str:
    """The table in the paper's form, then each group in full; ends with a newline."""
    lines = _paper_table(groups)
    for group in groups:
        lines += [''] + _group_lines(group)
    return '\n'.join(lines) + '\n'


def _paper_table(groups: Sequence[Group]) -> List[str]:
    rows = [('Experiment', 'Arm', 'Runs', 'Oracle recoveries', 'Expert interventions', 'Ended in failure')]
    for group in groups:
        shares = [_share(group.of(name)) for name in (RECOVERIES, ANSWERED, 'ended in failure')]
        rows.append((group.experiment, group.arm, str(group.runs), shares[0], shares[1], shares[2]))
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    lines = ['  '.join(cell.ljust(width) if column < 2 else cell.rjust(width)
                       for column, (cell, width) in enumerate(zip(row, widths))).rstrip() for row in rows]
    rule = '-' * (sum(widths) + 2 * (len(widths) - 1))
    return ['Shared autonomy statistics: trials in which each happened at least once', rule, lines[0], rule,
            *lines[1:], rule]


def _share(count: Count) -> str:
    return '{} ({:.1f}%)'.format(count.trials, 100 * count.share)


def _group_lines(group: Group) -> List[str]:
    lines = ['{}, {}: {} runs'.format(group.experiment, group.arm, group.runs),
             '  {:<26}{:>8}{:>9}   {:<16}{:>8}'.format('', 'trials', 'share', '95% interval', 'events')]
    for count in group.counts:
        indent = '  ' if count.name in (ANSWERED, NOT_ANSWERED) else ''
        interval = '{:5.1f} to {:5.1f}%'.format(*(100 * bound for bound in count.interval))
        events = '' if count.events is None else str(count.events)
        lines.append('  {:<26}{:>8}{:>8.1f}%   {:<16}{:>8}'.format(
            indent + count.name, count.trials, 100 * count.share, interval, events).rstrip())
    if group.lost_events:
        lines.append('  {} events are missing in {} trials (gaps in their numbering): these figures are lower '
                     'bounds'.format(group.lost_events, group.trials_with_gaps))
    return lines


def as_data(groups: Sequence[Group], trials: Sequence[TrialSummary], skipped: Sequence[Skipped]) -> Dict[str, Any]:
    """All of it as plain data, for JSON."""
    return {
        'groups': [dict(group._asdict(), counts=[item._asdict() for item in group.counts]) for group in groups],
        'trials': [_trial_data(trial) for trial in trials],
        'skipped': [item._asdict() for item in skipped]}


def _trial_data(trial: TrialSummary) -> Dict[str, Any]:
    return dict(trial._asdict(), ending=trial.ending.value, failures_by_state=dict(trial.failures_by_state))


def write_json(target: IO[str], groups: Sequence[Group], trials: Sequence[TrialSummary],
               skipped: Sequence[Skipped]) -> None:
    """Write everything as one JSON object."""
    json.dump(as_data(groups, trials, skipped), target, indent=1, sort_keys=True)
    target.write('\n')


def write_csv(target: IO[str], trials: Sequence[TrialSummary]) -> None:
    """Write one line a trial, for a spreadsheet or for statistics of one's own."""
    columns = [name for name in TrialSummary._fields if name not in ('failures_by_state', 'bags')]
    writer = csv.writer(target, lineterminator='\n')
    writer.writerow(columns)
    for trial in trials:
        data = _trial_data(trial)
        writer.writerow(['' if data[name] is None else data[name] for name in columns])
