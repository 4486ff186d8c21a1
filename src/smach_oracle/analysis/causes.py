"""Tables of how trials went by the cause that a simulated world was given to fail with."""

from typing import Dict, List, NamedTuple, Sequence

from .counting.trial_summary import TrialSummary
from .trial_counter import TrialEnding
from .variants import find_variants

NO_CAUSE = '(none)'


class CauseRow(NamedTuple):
    """The trials of one variant that were given a cause of one kind. Each row counts trials."""

    experiment: str
    variant: str
    kind: str
    trials: int
    failed: int  # in which a state failed at least once
    recovered: int  # in which the oracle recovered at least once without the expert
    asked: int  # in which a question was put to the expert
    ended_in_success: int  # by the machine's outcome
    true_success: int  # by the world's judge
    other_end: int = 0  # the machine's outcome says neither success nor failure


def cause_rows(trials: Sequence[TrialSummary]) -> List[CauseRow]:
    """Return one row for each variant and kind of cause, in alphabetical order.

    A trial is in the row of each of its kinds.
    """
    rows = []
    for variant in find_variants(trials):
        by_kind: Dict[str, List[TrialSummary]] = {}
        for trial in variant.trials:
            if trial.cause is not None:
                for kind in set(trial.cause.kinds) or {NO_CAUSE}:
                    by_kind.setdefault(kind, []).append(trial)
        rows += [
            _row(variant.experiment, variant.name, kind, by_kind[kind]) for kind in sorted(by_kind)
        ]
    return rows


def _row(experiment: str, variant: str, kind: str, trials: Sequence[TrialSummary]) -> CauseRow:
    return CauseRow(
        experiment,
        variant,
        kind,
        len(trials),
        sum(trial.failures > 0 for trial in trials),
        sum(trial.recoveries > 0 for trial in trials),
        sum(trial.questions > 0 for trial in trials),
        sum(trial.succeeded for trial in trials),
        sum(trial.truth is not None and trial.truth.success for trial in trials),
        sum(trial.ending is TrialEnding.OTHER for trial in trials),
    )


def format_causes(rows: Sequence[CauseRow]) -> str:
    """Return the rows as text, a table for each variant, or '' where no trial has a cause."""
    lines: List[str] = []
    width = max([len(row.kind) for row in rows] + [5])
    heading = '  {:<{}}{:>8}{:>8}{:>11}{:>7}{:>11}{:>14}'.format(
        'cause', width, 'trials', 'failed', 'recovered', 'asked', 'succeeded', 'true success'
    )
    has_other = any(row.other_end for row in rows)
    if has_other:
        heading += '{:>11}'.format('other end')
    variant = ('', '')
    for row in rows:
        if (row.experiment, row.variant) != variant:
            variant = (row.experiment, row.variant)
            lines += [
                '',
                '{}, {}: trials by what the world was given to fail with'.format(*variant),
                heading,
            ]
        lines.append(
            '  {:<{}}{:>8}{:>8}{:>11}{:>7}{:>11}{:>14}'.format(
                row.kind,
                width,
                row.trials,
                row.failed,
                row.recovered,
                row.asked,
                row.ended_in_success,
                row.true_success,
            )
            + ('{:>11}'.format(row.other_end) if has_other else '')
        )
    return '\n'.join(lines + ['']) if lines else ''
