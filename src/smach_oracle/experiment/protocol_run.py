"""A protocol, run by one command or told in advance, as `run_trials --protocol` has it."""

import argparse
from pathlib import Path
from typing import Dict, List, Optional, Tuple

from smach_oracle.analysis.bag_events import BagError
from smach_oracle.analysis.comparison import format_comparison
from smach_oracle.analysis.drawing.command import draw_all, find_rows
from smach_oracle.analysis.trial_rows import read_rows
from smach_oracle.packages import lacking

from .estimate import JobWork, duration, paces, seconds_left, seconds_missing
from .freeze import BLOCKS, checkout, frozen_seeds, last_freeze
from .plan import TASKS, ExperimentError
from .pool import run_parts
from .protocols import Part, ProtocolChoice, parts_of
from .results import RESULTS_FILE

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


def run_protocol(args: argparse.Namespace, output: Path) -> Tuple[int, str]:
    """Run the parts in one pool, compare the variants, draw the figures, and name what is missing.

    Figures and tables are of all rows in the folder, also those of other parts.

    :returns: the exit code, and a text to print.
    :raises ExperimentError: as run_parts() does.
    """
    result = run_parts(chosen_parts(args), output, args.jobs, args.hung_after)
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
    by_part = [(part, _works(part, output)) for part in parts]
    pace = paces([work for _, works in by_part for work in works])
    for part, works in by_part:
        plan, everything = part.plan, everything + works
        total = plan.trials * plan.replicates * len(plan.variants)
        mine = seconds_missing([work._replace(took_s=(pace[work.task],)) for work in works])
        lines.append(
            '{:34}{:>12}{:>11}{:>8}{:>8}{:>12}  {}'.format(
                part.name or plan.task,
                plan.seed,
                plan.replicates,
                total,
                total - sum(work.missing for work in works),
                duration(sum(mine)),
                ' '.join(variant.name for variant in plan.variants),
            )
        )
    lines.append(
        '{} trials to run, {} at {} jobs at a time ({})'.format(
            sum(work.missing for work in everything),
            duration(seconds_left(everything, at_a_time)),
            at_a_time,
            ', '.join(
                '{:.1f} s a trial of {}'.format(each, task) for task, each in sorted(pace.items())
            ),
        )
    )
    return '\n'.join(lines)


def _works(part: Part, output: Optional[Path]) -> List[JobWork]:
    rows = output / part.name / RESULTS_FILE if output else None
    try:
        kept = read_rows(rows) if rows is not None and rows.exists() else []
    except BagError as err:
        raise ExperimentError(str(err)) from err
    works = []
    for replicate in range(part.plan.replicates):
        for variant in part.plan.variants:
            took = [
                row.wall_s
                for row in kept
                if (row.variant, row.replicate) == (variant.name, replicate)
            ]
            works.append(
                JobWork(
                    part.plan.task,
                    max(0, part.plan.trials - len(took)),
                    [each for each in took if each is not None],
                )
            )
    return works
