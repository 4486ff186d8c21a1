"""A protocol, run by one command or told in advance, as `run_trials --protocol` has it."""

import argparse
from pathlib import Path
from typing import Dict, List, Mapping, Optional, Sequence, Tuple

from smach_oracle.analysis.bag_events import BagError
from smach_oracle.analysis.comparison import format_comparison, verdicts_text
from smach_oracle.analysis.drawing.command import draw_all, find_rows
from smach_oracle.analysis.trial_rows import TrialRow, read_rows
from smach_oracle.cluster import WorkerCluster
from smach_oracle.packages import lacking

from .estimate import (
    ALONE,
    BARE,
    SHARING,
    JobWork,
    duration,
    paces,
    replayed,
    seconds_left,
    seconds_missing,
)
from .freeze import BLOCKS, checkout, frozen_seeds, last_freeze
from .plan import TASKS, ExperimentError, ExperimentPlan
from .pool import run_parts
from .protocols import Part, ProtocolChoice, parts_of
from .results import RESULTS_FILE

_Place = Tuple[object, ...]  # what jobs have in common that run the same trials
FIGURES = 'figures'  # folder in that of a protocol
DONE, FAILED, LOST = 0, 1, 3  # exit codes


def chosen_parts(args: argparse.Namespace) -> List[Part]:
    """Return the parts that a command line asks for.

    :raises ExperimentError: where the frozen seeds cannot be used.
    """
    seeds = frozen_blocks(checkout()) if args.frozen else dict.fromkeys(BLOCKS, args.seed)
    return parts_of(
        args.protocol,
        ProtocolChoice(
            seeds,
            args.answer_delay,
            tuple(args.names),
            (args.task,) if args.task else tuple(sorted(TASKS)),
            args.trials,
            args.replicates,
        ),
    )


def frozen_blocks(root: Path) -> Dict[str, int]:
    """Return the first seed of each block of the freeze that holds.

    :raises ExperimentError: where none holds, or the checkout is not what was frozen.
    """
    last, here = last_freeze(root), frozen_seeds(root)
    if last.first_seed != here.first_seed:
        raise ExperimentError(
            'the checkout is not what was frozen at commit {}'.format(last.commit)
        )
    return last.blocks()


def run_protocol(
    args: argparse.Namespace, output: Path, cluster: Optional[WorkerCluster] = None
) -> Tuple[int, str]:
    """Run the parts in one pool, compare the variants, draw the figures, and name what is missing.

    Figures and tables are of all rows in the folder, also those of other parts.

    :returns: the exit code, and a text to print.
    :raises ExperimentError: as run_parts() does.
    """
    result = run_parts(chosen_parts(args), output, args.jobs, args.hung_after, cluster)
    lost = [
        '{}: seed {}: {}'.format(job.name, *each)
        for _, jobs in result.parts
        for job in jobs
        for each in sorted(job.lost.items())
    ]
    told = compared(output)
    for title, texts in (
        ('Lost trials', lost),
        ('Replicates that were left', ['{}: {}'.format(*each) for each in result.broken.items()]),
    ):
        if texts:
            told.append('{}:\n  {}'.format(title, '\n  '.join(texts)))
    told.append('Rows, bags and logs: {}'.format(output))
    return FAILED if result.broken else LOST if lost else DONE, '\n'.join(told)


def compared(output: Path) -> List[str]:
    """Compare the variants of each figure, draw the figures, and return texts to print.

    What cannot be drawn is told, for the trials are there.
    """
    try:
        found = find_rows(output)
    except BagError as err:
        return [str(err)]
    texts = [
        '{}\n\n{}'.format(kind.capitalize(), format_comparison(rows))
        for kind, rows in found.items()
    ]
    texts += filter(None, [verdicts_text([row for rows in found.values() for row in rows])])
    try:
        paths = draw_all(found, output / FIGURES)
    except OSError as err:
        return texts + ['Figures were not drawn: {}'.format(err)]
    except ImportError as err:
        return texts + ['Figures were not drawn: {}'.format(lacking(err) or err)]
    return texts + ['Figures and tables:\n  {}'.format('\n  '.join(map(str, paths)))]


def plan_text(parts: List[Part], output: Optional[Path], at_a_time: int) -> str:
    """Return what would be run, and how long it takes.

    :param output: the experiment's folder, whose rows count as done. None means there is none yet.
    """
    lines = [
        '{:34}{:>12}{:>11}{:>8}{:>8}{:>12}  {}'.format(
            'part', 'seeds from', 'replicates', 'trials', 'done', 'one by one', 'variants'
        )
    ]
    everything: List[JobWork] = []
    kept = [(part, _kept(part, output)) for part in parts]
    bare = _bare_rows(kept)
    by_part = [(part, _works(part.plan, rows, bare)) for part, rows in kept]
    pace = paces([work for _, works in by_part for work in works])
    for part, works in by_part:
        plan, everything = part.plan, everything + works
        total = plan.trials * plan.replicates * len(plan.variants)
        mine = seconds_missing(works, pace)
        lines.append(
            '{:34}{:>12}{:>11}{:>8}{:>8}{:>12}  {}'.format(
                part.name or plan.task,
                plan.seed,
                plan.replicates,
                total,
                total - _left(works),
                duration(sum(mine)),
                ' '.join(variant.name for variant in plan.variants),
            )
        )
    shared = sum(work.replays for work in everything)
    lines.append(
        '{} trials to run{}, {} at {} jobs at a time ({})'.format(
            round(sum(work.missing for work in everything)),
            ', and about {:.0f} that they share'.format(shared) if shared else '',
            duration(seconds_left(everything, at_a_time)),
            at_a_time,
            ', '.join(
                '{:.1f} s a trial of {}{}'.format(each, task, _KINDS[kind])
                for (task, kind), each in sorted(pace.items())
            ),
        )
    )
    return '\n'.join(lines)


_KINDS = {ALONE: '', BARE: ', bare', SHARING: ', where trials are shared'}


def _left(works: List[JobWork]) -> int:
    """Return how many trials have no rows yet, those that are shared among them."""
    return round(sum(work.missing + work.replays for work in works))


def _kept(part: Part, output: Optional[Path]) -> List[TrialRow]:
    """Return the rows that a part has.

    :raises ExperimentError: where they cannot be read.
    """
    rows = output / part.name / RESULTS_FILE if output else None
    try:
        return read_rows(rows) if rows is not None and rows.exists() else []
    except BagError as err:
        raise ExperimentError(str(err)) from err


def _bare_rows(kept: Sequence[Tuple[Part, List[TrialRow]]]) -> Dict[_Place, List[TrialRow]]:
    """Return the rows of each bare job whose trials others share, none where it has not begun."""
    return {
        _place(part.plan, replicate): [
            row for row in rows if (row.variant, row.replicate) == (variant.name, replicate)
        ]
        for part, rows in kept
        if part.plan.shares and part.plan.hours is None
        for variant in part.plan.variants
        if not variant.recovers
        for replicate in range(part.plan.replicates)
    }


def _place(plan: ExperimentPlan, replicate: int) -> _Place:
    """Return what jobs have in common that run the same trials."""
    return plan.task, plan.first_seed(replicate), plan.trials, plan.lasting, plan.extra_causes


def _works(
    plan: ExperimentPlan, kept: Sequence[TrialRow], bare: Mapping[_Place, Sequence[TrialRow]]
) -> List[JobWork]:
    works = []
    for replicate in range(plan.replicates):
        first, place = plan.first_seed(replicate), _place(plan, replicate)
        for variant in plan.variants:
            mine = [
                row for row in kept if (row.variant, row.replicate) == (variant.name, replicate)
            ]
            left = set(range(first, first + plan.trials)) - {row.seed for row in mine}
            took = [row.wall_s for row in mine if row.wall_s is not None and not row.shared]
            kind, shared = ALONE if variant.recovers else BARE, 0.0
            if variant.recovers and plan.shares and place in bare:
                kind, shared = SHARING, replayed(plan.task, left, bare[place])
            works.append(JobWork(plan.task, len(left) - shared, took, kind, shared))
    return works
