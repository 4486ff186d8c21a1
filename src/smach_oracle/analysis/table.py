"""The paper's Table I from the groups of trials, and files of the data behind it (definitions: doc/statistics.md)."""
import csv
import json
from typing import Any, Dict, IO, List, Sequence

from .bag_events import Skipped
from .causes import cause_rows, format_causes
from .groups import ANSWERED, ENDED_IN_FAILURE, NOT_ANSWERED, RECOVERIES, TRUE_SUCCESS, Count, Group
from .trials import TrialSummary

_INDENTED = (ANSWERED, NOT_ANSWERED)


def format_text(groups: Sequence[Group], trials: Sequence[TrialSummary] = ()) -> str:
    """The table in the paper's form, each group in full, the causes of the trials; ends with a newline."""
    lines = _paper_table(groups)
    for group in groups:
        lines += [''] + _group_lines(group)
    return '\n'.join(lines) + '\n' + format_causes(cause_rows(trials))


def _paper_table(groups: Sequence[Group]) -> List[str]:
    headings = ['Experiment', 'Arm', 'Runs', 'Oracle recoveries', 'Expert interventions', 'Ended in failure']
    names = [RECOVERIES, ANSWERED, ENDED_IN_FAILURE]
    if any(group.truth_known for group in groups):
        headings, names = headings + ['True success'], names + [TRUE_SUCCESS]
    rows = [headings]
    for group in groups:
        shares = [_share(group, name) for name in names]
        rows.append([group.experiment, group.arm, str(group.runs)] + shares)
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    lines = ['  '.join(cell.ljust(width) if column < 2 else cell.rjust(width)
                       for column, (cell, width) in enumerate(zip(row, widths))).rstrip() for row in rows]
    rule = '-' * (sum(widths) + 2 * (len(widths) - 1))
    return ['Shared autonomy statistics: trials in which each happened at least once', rule, lines[0], rule,
            *lines[1:], rule]


def _share(group: Group, name: str) -> str:
    found = [count for count in group.counts if count.name == name]
    return '{} ({:.1f}%)'.format(found[0].trials, 100 * found[0].share) if found else 'unknown'


def _group_lines(group: Group) -> List[str]:
    several = group.replicates > 1
    heading = '  {:<26}{:>8}{:>9}   {:<16}{:>8}'.format('', 'trials', 'share', '95% interval', 'events')
    lines = ['{}, {}: {} runs{}'.format(group.experiment, group.arm, group.runs,
                                        ' in {} replicates'.format(group.replicates) if several else ''),
             heading + ('   over replicates' if several else '')]
    lines += [_count_line(count) for count in group.counts]
    if 0 < group.truth_known < group.runs:
        lines.append('  how a trial truly ended is known of {} of {}'.format(group.truth_known, group.runs))
    if group.lost_events:
        lines.append('  {} events are missing in {} trials (gaps in their numbering): these figures are lower '
                     'bounds'.format(group.lost_events, group.trials_with_gaps))
    return lines


def _count_line(count: Count) -> str:
    indent = '  ' if count.name in _INDENTED else ''
    events = '' if count.events is None else str(count.events)
    over = over_replicates(count)
    return '  {:<26}{:>8}{:>8.1f}%   {:<16}{:>8}   {}'.format(
        indent + count.name, count.trials, 100 * count.share, percent(count.interval), events, over).rstrip()


def over_replicates(count: Count) -> str:
    """The interval over replicates in words; those that all agree tell nothing of how much others would differ."""
    if count.over_replicates is None:
        return ''
    low, high = count.over_replicates
    return 'all alike' if high - low < 1e-9 else percent(count.over_replicates)


def percent(interval: Sequence[float]) -> str:
    """An interval of shares in words, e.g. " 1.8 to  8.5%"."""
    return '{:5.1f} to {:5.1f}%'.format(*(100 * bound for bound in interval))


def as_data(groups: Sequence[Group], trials: Sequence[TrialSummary], skipped: Sequence[Skipped]) -> Dict[str, Any]:
    """All of it as plain data, for JSON."""
    return {
        'groups': [dict(group._asdict(), counts=[item._asdict() for item in group.counts]) for group in groups],
        'causes': [row._asdict() for row in cause_rows(trials)],
        'trials': [_trial_data(trial) for trial in trials],
        'skipped': [item._asdict() for item in skipped]}


def _trial_data(trial: TrialSummary) -> Dict[str, Any]:
    return dict(trial._asdict(), ending=trial.ending.value, failures_by_state=dict(trial.failures_by_state),
                settings=dict(trial.settings), cause=trial.cause._asdict() if trial.cause else None,
                truth=trial.truth._asdict() if trial.truth else None)


def write_json(target: IO[str], groups: Sequence[Group], trials: Sequence[TrialSummary],
               skipped: Sequence[Skipped]) -> None:
    """Write everything as one JSON object."""
    json.dump(as_data(groups, trials, skipped), target, indent=1, sort_keys=True)
    target.write('\n')


def write_csv(target: IO[str], trials: Sequence[TrialSummary]) -> None:
    """Write one line a trial, for a spreadsheet or for statistics of one's own."""
    plain = [name for name in TrialSummary._fields
             if name not in ('failures_by_state', 'bags', 'settings', 'cause', 'truth')]
    writer = csv.writer(target, lineterminator='\n')
    writer.writerow(plain + ['seed', 'causes', 'true_success', 'why', 'sim_s', 'wall_s'])
    for trial in trials:
        data = _trial_data(trial)
        cause, truth = trial.cause, trial.truth
        told = [cause.seed, ' '.join(cause.kinds)] if cause else ['', '']
        told += [truth.success, truth.why, truth.sim_s, truth.wall_s] if truth else [''] * 4
        writer.writerow(['' if data[name] is None else data[name] for name in plain] + told)
