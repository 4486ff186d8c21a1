"""The paper's Table I from the counts of variants, and files of the data behind it.

Definitions: doc/statistics.md.
"""

import csv
import json
from collections import Counter
from typing import IO, Any, Dict, List, Mapping, Optional, Sequence, Tuple

from smach_oracle.oracle.settings.failure_rule import BY_NAME_VERSION, FORMER_RULE, RULE

from .bag_events import SkippedBag
from .causes import cause_rows, format_causes
from .counting.trial_summary import TrialSummary
from .recorded.trial_line import TrialLine, trial_lines
from .trial_counter import EXPERT_ANSWERED, PERSON_NEEDED
from .variants import (
    ANSWERED,
    ENDED_IN_FAILURE,
    NOT_ANSWERED,
    OTHER_END,
    RECOVERIES,
    TRUE_SUCCESS,
    Count,
    VariantCounts,
)

_INDENTED = (ANSWERED, NOT_ANSWERED)
_WORDS = {ANSWERED: EXPERT_ANSWERED}  # of a count in text


def format_text(variants: Sequence[VariantCounts], trials: Sequence[TrialSummary] = ()) -> str:
    """Return the table in the paper's form, each variant in full, and the causes.

    It ends with a newline.
    """
    lines = _paper_table(variants)
    for variant in variants:
        lines += [''] + _variant_lines(variant)
    return '\n'.join(lines) + '\n' + format_causes(cause_rows(trials)) + _rules(trials)


def _paper_table(variants: Sequence[VariantCounts]) -> List[str]:
    return [
        'Shared autonomy statistics: trials in which each happened at least once',
        *group_table(variants, 'Variant'),
        *_what_columns_mean(variants),
    ]


def group_table(variants: Sequence[VariantCounts], what: str) -> List[str]:
    """Return the lines of a table with a row for each variant. `what`: heads their names."""
    headings = [
        'Experiment',
        what,
        'Trials',
        'Oracle recoveries',
        'Expert answered',
        'Ended in failure',
    ]
    names = [RECOVERIES, ANSWERED, ENDED_IN_FAILURE]
    if any(variant.has(OTHER_END) for variant in variants):
        headings, names = headings + ['Other end'], names + [OTHER_END]
    if any(variant.truth_known for variant in variants):
        headings, names = headings + ['True success'], names + [TRUE_SUCCESS]
    headings, names = headings + ['Person needed'], names + [PERSON_NEEDED]
    above, below = zip(*(_in_two_lines(heading) for heading in headings))
    rows = [list(above), list(below)]
    for variant in variants:
        shares = [_share(variant, name) for name in names]
        rows.append([variant.experiment, variant.name, str(variant.trials)] + shares)
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    lines = [
        '  '.join(
            cell.ljust(width) if column < 2 else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(row, widths))
        ).rstrip()
        for row in rows
    ]
    rule = '-' * (sum(widths) + 2 * (len(widths) - 1))
    return [rule, *lines[:2], rule, *lines[2:], rule]


def _in_two_lines(heading: str) -> Tuple[str, str]:
    above, _, below = heading.rpartition(' ')
    return above, below


def _what_columns_mean(variants: Sequence[VariantCounts]) -> List[str]:
    lines = [
        'Expert answered: a question, at least. The paper\'s column "expert interventions".',
        'Person needed: a question was asked, or the trial did not truly end in success.',
    ]
    unjudged = sum(variant.unjudged for variant in variants)
    if unjudged:
        lines += [
            '  At least: no judge saw {} trial{} that ended with neither a failure nor a '
            'question.'.format(unjudged, 's' if unjudged > 1 else ''),
            '  How many of them are false successes is not known.',
        ]
    return lines


def _share(variant: VariantCounts, name: str) -> str:
    found = [count for count in variant.counts if count.name == name]
    if name == OTHER_END and not found:
        return '0 (0.0%)'
    return '{} ({:.1f}%)'.format(found[0].trials, 100 * found[0].share) if found else 'unknown'


def _variant_lines(variant: VariantCounts) -> List[str]:
    several = variant.replicates > 1
    heading = '  {:<26}{:>8}{:>9}   {:<16}{:>8}'.format(
        '', 'trials', 'share', '95% interval', 'events'
    )
    lines = [
        '{}, {}: {} trials{}'.format(
            variant.experiment,
            variant.name,
            variant.trials,
            ' in {} replicates'.format(variant.replicates) if several else '',
        ),
        heading + ('   over replicates' if several else ''),
    ]
    lines += [_count_line(count) for count in variant.counts]
    if variant.unjudged:
        lines.append(
            '    at least: how many false successes are among {} others is not known'.format(
                variant.unjudged
            )
        )
    if 0 < variant.truth_known < variant.trials:
        lines.append(
            '  how a trial truly ended is known of {} of {}'.format(
                variant.truth_known, variant.trials
            )
        )
    if variant.resumed:
        lines.append(
            '  {} trials were resumed after their program was stopped; it was down for '
            '{:.0f} s in all'.format(variant.resumed, variant.down_s)
        )
    if variant.lost_events:
        lines.append(
            '  {} events are missing in {} trials (gaps in their numbering): these figures are '
            'lower '
            'bounds'.format(variant.lost_events, variant.trials_with_gaps)
        )
    return lines


def _count_line(count: Count) -> str:
    indent = '  ' if count.name in _INDENTED else ''
    events = '' if count.events is None else str(count.events)
    over = over_replicates(count)
    return '  {:<26}{:>8}{:>8.1f}%   {:<16}{:>8}   {}'.format(
        indent + _WORDS.get(count.name, count.name),
        count.trials,
        100 * count.share,
        percent(count.interval),
        events,
        over,
    ).rstrip()


def _rules(trials: Sequence[TrialSummary]) -> str:
    lines = rules_of(trials)
    return '\n'.join(['', lines[0], *('  ' + line for line in lines[1:]), '']) if lines else ''


def rules_of(trials: Sequence[TrialSummary]) -> List[str]:
    """Return the rules by which failures were told, a line each, where the trials have several."""
    counts = Counter(trial.rule for trial in trials)
    if len(counts) < 2 and not any(rule.is_of_later_version for rule in counts):
        return []
    lines = ['These trials told failures by different rules. Each is counted by its own:']
    if len(counts) < 2:
        lines = ['A later version of smach_oracle has recorded these trials:']
    for rule, number in sorted(counts.items(), key=lambda each: str(each[0])):
        note = ''
        if rule.is_of_later_version:
            note = ' (not known here: counted as version {})'.format(BY_NAME_VERSION)
        lines.append('{:>6} {}{}'.format(number, rule, note))
    return lines


def over_replicates(count: Count) -> str:
    """Return the interval over replicates in words.

    Replicates that all agree do not show how much others would differ.
    """
    if count.over_replicates is None:
        return ''
    low, high = count.over_replicates
    return 'all alike' if high - low < 1e-9 else percent(count.over_replicates)


def percent(interval: Sequence[float]) -> str:
    """Return an interval of shares in words, e.g. " 1.8 to  8.5%"."""
    return '{:5.1f} to {:5.1f}%'.format(*(100 * bound for bound in interval))


def as_data(
    variants: Sequence[VariantCounts], trials: Sequence[TrialSummary], skipped: Sequence[SkippedBag]
) -> Dict[str, Any]:
    """Return all of it as plain data, for JSON."""
    return {
        'groups': [variant_data(variant) for variant in variants],
        'causes': [dict(row._asdict(), arm=row.variant) for row in cause_rows(trials)],
        'trials': [_trial_data(trial) for trial in trials],
        'skipped': [item._asdict() for item in skipped],
    }


def variant_data(variant: VariantCounts) -> Dict[str, Any]:
    """Return plain data, with `arm` and `runs`, the older names of `variant` and `trials`.

    The count `answered` is there as `expert answered`, too.
    """
    counts = [item._asdict() for item in variant.counts]
    counts += [dict(item, name=_WORDS[item['name']]) for item in counts if item['name'] in _WORDS]
    data = dict(variant._asdict(), counts=counts)
    name = data.pop('name')
    return dict(data, variant=name, arm=name, runs=variant.trials)


def _trial_data(trial: TrialSummary) -> Dict[str, Any]:
    data = trial._asdict()
    del data['rule']
    if trial.rule != FORMER_RULE:
        data[RULE] = trial.rule.as_data()
    return dict(
        data,
        ending=trial.ending.value,
        failures_by_state=dict(trial.failures_by_state),
        settings=dict(trial.settings),
        origin=dict(trial.origin),
        inputs=dict(trial.inputs),
        cause=trial.cause._asdict() if trial.cause else None,
        truth=trial.truth._asdict() if trial.truth else None,
        expert_answered=trial.answered > 0,
        person_needed=trial.person_needed,
    )


def write_json(
    target: IO[str],
    variants: Sequence[VariantCounts],
    trials: Sequence[TrialSummary],
    skipped: Sequence[SkippedBag],
    more: Optional[Mapping[str, Any]] = None,
) -> None:
    """Write everything as one JSON object. `more`: further keys of it."""
    json.dump(
        dict(as_data(variants, trials, skipped), **(more or {})), target, indent=1, sort_keys=True
    )
    target.write('\n')


def write_csv(target: IO[str], trials: Sequence[TrialSummary]) -> None:
    """Write one line a trial, for a spreadsheet or for your own statistics."""
    writer = csv.writer(target, lineterminator='\n')
    writer.writerow(TrialLine._fields)
    for line in trial_lines(trials):
        writer.writerow(['' if value is None else value for value in line])
