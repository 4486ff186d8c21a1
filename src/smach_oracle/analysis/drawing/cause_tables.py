"""Tables by the causes that trials were given, and by what the world's log says of them."""

from functools import partial
from typing import Callable, Dict, List, Mapping, Sequence, Tuple

from ..intervals import wilson_interval
from ..lasting.causes_log import causes_in
from ..lasting.checks import OPEN_ENDED, TrialCheck, checks_of
from ..pairing import BARE, COMPARED, RESTART, on_common_seeds
from ..trial_counter import PERSON_NEEDED
from ..trial_rows import TrialRow
from .markdown import titled

NONE = 'none'
NOT_TOLD = 'not told'
RETRY = 'retry'  # a variant: the same state again
Rows = Mapping[str, Sequence[TrialRow]]  # by variant


def by_cause(title: str, variants: Rows) -> List[str]:
    """Return a table for each variant that is compared: a line for each listed cause."""
    return [
        _of_variant('{}: {}, by listed cause'.format(title, name), variants[name])
        for name in COMPARED
        if name in variants
    ]


def _of_variant(title: str, rows: Sequence[TrialRow]) -> str:
    by_kind: Dict[str, List[TrialRow]] = {}
    for row in rows:
        for kind in dict.fromkeys(row.causes.split()) or (NONE,):
            by_kind.setdefault(kind, []).append(row)
    classes = _classes(rows)
    lines = []
    for kind in sorted(by_kind, key=lambda kind: (kind == NONE, kind)):
        mine = by_kind[kind]
        failed = _count(mine, lambda row: row.failures > 0)
        lines.append(
            [
                kind.replace('_', ' '),
                classes.get(kind, '-'),
                str(len(mine)),
                share_text(failed, len(mine)) if kind == NONE else str(failed),
                str(_count(mine, lambda row: row.intervened)),
                str(_count(mine, lambda row: row.succeeded)),
            ]
        )
    return titled(
        title,
        ['cause', 'class', 'trials', 'with a failure', PERSON_NEEDED, 'true success'],
        lines,
        ['A trial with two causes is in two lines. In parentheses: a 95% Wilson interval.'],
    )


def by_class(title: str, variants: Rows) -> List[str]:
    """Return a table of the trials that needed a person, by class of cause.

    It is of the trials that all variants that are compared ran. Empty where one of them is missing.
    """
    if any(name not in variants for name in COMPARED):
        return []
    rows = on_common_seeds([row for name in COMPARED for row in variants[name]])
    bare = [row for row in rows if row.variant == BARE]
    parts: List[Tuple[str, Callable[[TrialRow], bool]]] = [
        ('no listed cause', lambda row: not row.causes),
        ('passing causes alone', lambda row: bool(row.causes) and not row.lasting),
        ('a lasting cause', lambda row: bool(row.causes) and bool(row.lasting)),
    ]
    kinds = sorted({kind for row in bare for kind in row.causes.split()})
    parts += [('with ' + kind.replace('_', ' '), partial(_has, kind)) for kind in kinds]
    parts.append(('all', lambda row: True))
    lines = []
    for name, belongs in parts:
        mine = [row for row in rows if belongs(row)]
        of = len(mine) // len(COMPARED)
        if of:
            counts = [
                _count([row for row in mine if row.variant == variant], lambda row: row.intervened)
                for variant in COMPARED
            ]
            lines.append(
                [name, str(of), *('{} ({:.0%})'.format(count, count / of) for count in counts)]
            )
    return [
        titled(
            title + ': person needed, by cause',
            ['trials', 'number', *COMPARED],
            lines,
            [
                'The {} trials that bare, default and restart ran. A trial with two causes '
                'is in two lines.'.format(len(bare))
            ],
        )
    ]


def _has(kind: str, row: TrialRow) -> bool:
    return kind in row.causes.split()


def _count(rows: Sequence[TrialRow], happened: Callable[[TrialRow], bool]) -> int:
    return sum(map(happened, rows))


def _classes(rows: Sequence[TrialRow]) -> Dict[str, str]:
    return {
        cause.kind: 'lasts' if cause.lasting else 'passes'
        for row in rows
        if row.cause_log
        for cause in causes_in(row.cause_log)
    }


def share_text(number: int, of: int) -> str:
    """Return a number of trials, and its share with a Wilson interval."""
    if not of:
        return '0 of 0'
    return '{} of {}, {:.1%} ({:.0%} to {:.0%})'.format(
        number, of, number / of, *wilson_interval(number, of)
    )


def by_log(title: str, variants: Rows) -> List[str]:
    """Return a table of which kinds lasted, and the shares of trials with a lasting cause.

    It is of RESTART, which tries every failed state again after a restart. The second try without a
    restart is that of RETRY. Empty where no row of RESTART has the log.
    """
    restarted, retried = (checks_of(variants.get(name, ())) for name in (RESTART, RETRY))
    if not restarted:
        return []
    classes = _classes(variants[RESTART])
    lines = []
    for kind in sorted(classes):
        mine, others = _with(restarted, kind), _with(retried, kind)
        again = [each.after_restart for each in mine if each.after_restart is not None]
        second = [each.at_second_try for each in others if each.at_second_try is not None]
        lines.append(
            [
                kind.replace('_', ' '),
                classes[kind],
                str(len(mine)),
                str(sum(each.failed for each in mine)),
                *(
                    NOT_TOLD
                    if kind in OPEN_ENDED
                    else '{} of {}'.format(sum(kind in each for each in found), len(found))
                    for found in (again, second)
                ),
            ]
        )
    return [
        titled(
            title + ": causes that last, by the world's log",
            [
                'cause',
                'class',
                'trials of `restart`',
                'a state failed',
                'there at that state after a restart',
                'there at the second try of `retry`',
            ],
            lines,
            _shares(restarted, classes)
            + [
                'The log gives no end to {}: so it does not tell whether that lasts, and it does '
                'not count as lasting by the log.'.format(kind.replace('_', ' '))
                for kind in sorted(OPEN_ENDED & set(classes))
            ],
        )
    ]


def _with(checks: Sequence[TrialCheck], kind: str) -> List[TrialCheck]:
    return [each for each in checks if any(cause.kind == kind for cause in each.causes)]


def _shares(checks: Sequence[TrialCheck], classes: Mapping[str, str]) -> List[str]:
    told = [each for each in checks if each.lasting_by_log is not None]
    shown = {
        kind
        for kind in classes
        if classes[kind] == 'lasts' and any(kind in (each.lasting_by_log or ()) for each in told)
    }
    failed = sum(each.failed for each in checks)
    by_class = sum(bool(each.lasting_by_class) for each in told)
    logged = sum(bool(each.lasting_by_log) for each in told)
    return [
        'Trials of `restart` with a cause that have one of a class that lasts: {}.'.format(
            share_text(sum(bool(each.lasting_by_class) for each in checks), len(checks))
        ),
        'With the kinds alone that the log showed to last at least once: {}.'.format(
            share_text(sum(bool(each.lasting_by_class & shown) for each in checks), len(checks))
        ),
        'Those in which a state failed and was tried again after a restart: by class {}, by the '
        'log {}.'.format(share_text(by_class, len(told)), share_text(logged, len(told))),
        'By the log, a cause lasts that was there at the second try of the state that failed '
        'first, and at that state after a restart. Under `restart` these are one moment. Of {} '
        'trials the log cannot say it, as no state failed, and of {} as the failed state was not '
        'tried again.'.format(len(checks) - failed, failed - len(told)),
    ]
