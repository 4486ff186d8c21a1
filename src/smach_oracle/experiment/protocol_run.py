"""A protocol, run by one command or told in advance, as `run_trials --protocol` has it."""
import argparse
from pathlib import Path
from typing import Dict, List, Optional, Tuple

from smach_oracle.analysis.bag_events import BagError
from smach_oracle.analysis.comparison import format_comparison
from smach_oracle.analysis.trial_rows import read_rows

from .estimate import JobWork, duration, paces, seconds_left, seconds_missing
from .freeze import BLOCKS, checkout, frozen_seeds, last_freeze
from .plan import TASKS, ExperimentError
from .pool import run_parts
from .protocols import Part, ProtocolChoice, parts_of
from .results import RESULTS_FILE

DONE, FAILED, LOST = 0, 1, 3  # exit codes


def chosen_parts(args: argparse.Namespace) -> List[Part]:
    """Return the parts that a command line asks for.

    :raises ExperimentError: where the frozen seeds cannot be used.
    """
    seeds = frozen_blocks(checkout()) if args.frozen else dict.fromkeys(BLOCKS, args.seed)
    return parts_of(args.protocol, ProtocolChoice(
        seeds, args.answer_delay, tuple(args.names), (args.task,) if args.task else tuple(
            sorted(TASKS)), args.trials, args.replicates))


def frozen_blocks(root: Path) -> Dict[str, int]:
    """Return the first seed of each block of the freeze that holds.

    :raises ExperimentError: where none holds, or the checkout is not what was frozen.
    """
    last, here = last_freeze(root), frozen_seeds(root)
    if last.first_seed != here.first_seed:
        raise ExperimentError('the checkout is not what was frozen at commit {}'.format(
            last.commit))
    return last.blocks()


def run_protocol(args: argparse.Namespace, output: Path) -> Tuple[int, str]:
    """Run the parts in one pool, compare the variants of each, and name what is missing.

    :returns: the exit code, and a text to print.
    :raises ExperimentError: as run_parts() does.
    """
    result = run_parts(chosen_parts(args), output, args.jobs, args.hung_after)
    lost, told = [], []
    for part, jobs in result.parts:
        rows = output / part.name / RESULTS_FILE
        if rows.exists():
            told.append('Part {}\n{}'.format(part.name, format_comparison(read_rows(rows))))
        lost += ['{}: seed {}: {}'.format(job.name, *each) for job in jobs
                 for each in sorted(job.lost.items())]
    for title, texts in (('Lost trials', lost), ('Replicates that were left', [
            '{}: {}'.format(*each) for each in result.broken.items()])):
        if texts:
            told.append('{}:\n  {}'.format(title, '\n  '.join(texts)))
    told.append('Rows, bags and logs: {}'.format(output))
    return FAILED if result.broken else LOST if lost else DONE, '\n'.join(told)


def plan_text(parts: List[Part], output: Optional[Path], at_a_time: int) -> str:
    """Return what would be run, and how long it takes.

    :param output: the experiment's folder, whose rows count as done. None means there is none yet.
    """
    lines = ['{:34}{:>12}{:>11}{:>8}{:>8}{:>12}  {}'.format(
        'part', 'seeds from', 'replicates', 'trials', 'done', 'one by one', 'variants')]
    everything: List[JobWork] = []
    by_part = [(part, _works(part, output)) for part in parts]
    pace = paces([work for _, works in by_part for work in works])
    for part, works in by_part:
        plan, everything = part.plan, everything + works
        total = plan.trials * plan.replicates * len(plan.variants)
        mine = seconds_missing([work._replace(took_s=(pace[work.task],)) for work in works])
        lines.append('{:34}{:>12}{:>11}{:>8}{:>8}{:>12}  {}'.format(
            part.name or plan.task, plan.seed, plan.replicates, total,
            total - sum(work.missing for work in works), duration(sum(mine)),
            ' '.join(variant.name for variant in plan.variants)))
    lines.append('{} trials to run, {} at {} jobs at a time ({})'.format(
        sum(work.missing for work in everything),
        duration(seconds_left(everything, at_a_time)), at_a_time, ', '.join(
            '{:.1f} s a trial of {}'.format(each, task) for task, each in sorted(pace.items()))))
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
            took = [row.wall_s for row in kept
                    if (row.variant, row.replicate) == (variant.name, replicate)]
            works.append(JobWork(part.plan.task, max(0, part.plan.trials - len(took)),
                              [each for each in took if each is not None]))
    return works
