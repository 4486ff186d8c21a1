"""Run an experiment: the same seeds with and without the oracle, all recorded and counted.

Each job is a replicate of a variant, and has its own ROS master on a free port, its own world and
its own learned rates. What is started is stopped, also on Ctrl-C, pressed once or often. Started
again with the same --output, an experiment goes on where it was.
"""

import argparse
import contextlib
import os
import shutil
import sys
import time
from pathlib import Path
from typing import Any, Dict, List, Mapping, Optional, Sequence, Tuple

from smach_oracle.analysis import bag_statistics
from smach_oracle.cluster import ClusterError, WorkerCluster, add_options
from smach_oracle.oracle.decision.failure_rate import ESTIMATORS
from smach_oracle.oracle.decision.policies import POLICIES
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.settings.checks import number, whole
from smach_oracle.oracle.settings.paths import path_of
from smach_oracle.oracle.settings.settings import Settings
from smach_oracle.packages import lacking
from smach_oracle.renamed_option import RenamedOption

from .freeze import ABANDONED, FROZEN, checkout, run_freeze
from .job import HUNG_AFTER_S, LONGEST, ExperimentJob
from .plan import (
    BARE,
    CONFIGURED,
    DEFAULT,
    ONE_LINE,
    TASKS,
    ExperimentError,
    ExperimentPlan,
    Variant,
    enter_folder,
    make_variants,
    named_variants,
)
from .pool import alone_in, run
from .protocol_run import chosen_parts, plan_text, run_protocol
from .protocols import ALL, PROTOCOLS, Part
from .stop_signals import StopRequested

FAILED, LACKING, LOST = 1, 2, 3  # exit codes
JOBS = 2  # at a time
FREEZING = 'benchmarks/freeze_seeds.py'  # a script of developers
DEFAULT_TASK = 'pick_and_place'
LONGEST_DELAY = 3600.0  # s, of the operator
COUNT, SEED = whole(1, '1 or more'), whole(0, '0 or more')
SHARE, HOURS = number(0.0, 1.0, 'from 0 to 1'), number(0.01, 1000.0, 'from 0.01 to 1000')
DELAY = number(0.0, LONGEST_DELAY, 'from 0 to {:g}'.format(LONGEST_DELAY))
BOTH = ('both', 'with', 'without')  # the oracle
NAMED = (BARE, DEFAULT, *sorted(POLICIES), *(ONE_LINE + name for name in sorted(POLICIES)))
# Settings of the oracle that override those of the task: option, type, what it is.
OVERRIDES = (
    ('moderate_from', float, 'failure rate from which a state is MODERATE'),
    ('high_from', float, 'failure rate from which a state is HIGH'),
    ('prior', float, 'failure rate that a state starts with'),
    ('max_recoveries', int, 'recoveries per state and trial, before the expert is asked'),
)


def make_parser() -> argparse.ArgumentParser:
    """The parser of the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        '--protocol',
        choices=[*PROTOCOLS, ALL],
        help='the experiments of doc/protocol.md in one pool, each in a folder of its own below '
        '--output; --task, --trials, --replicates and --variants then choose some of them',
    )
    parser.add_argument(
        '--frozen',
        action='store_true',
        help='with --protocol: the evaluation seeds of the freeze that holds',
    )
    parser.add_argument(
        '--plan',
        dest='only_plan',
        action='store_true',
        help='run nothing: print what would be run, and how long it takes',
    )
    parser.add_argument(
        '--task', choices=sorted(TASKS), help='(default: pick_and_place; of a protocol: all)'
    )
    parser.add_argument(
        '--trials',
        metavar='N',
        type=int,
        help='per variant and replicate (default: {})'.format(
            ', '.join('{} of {}'.format(each.trials, task) for task, each in sorted(TASKS.items()))
        ),
    )
    parser.add_argument(
        '--seed',
        metavar='N',
        type=int,
        default=1,
        help='of the first trial; the next has the next (default: 1)',
    )
    parser.add_argument(
        '--replicates',
        metavar='N',
        type=int,
        help='complete repetitions on further seeds, each learns from the beginning (default: 1)',
    )
    parser.add_argument(
        '--jobs',
        metavar='N',
        type=int,
        help='replicates of variants at a time (default: 2; of a cluster: what its workers take)',
    )
    parser.add_argument(
        '--variants',
        nargs='+',
        choices=[*BOTH, *NAMED],
        default=['both'],
        metavar='NAME',
        help='both, with or without the oracle (default: both), or one or more of: {}'.format(
            ', '.join(NAMED)
        ),
    )
    parser.add_argument(
        '--arms',
        dest='variants',
        nargs=1,
        choices=BOTH,
        default=argparse.SUPPRESS,
        action=RenamedOption,
        help=argparse.SUPPRESS,
    )
    parser.add_argument(
        '--policy',
        nargs='+',
        choices=[CONFIGURED] + sorted(POLICIES),
        default=[CONFIGURED],
        help="instead of the task's own, which is as configured (default); one variant for each",
    )
    parser.add_argument(
        '--memory',
        nargs='+',
        type=int,
        metavar='N',
        help="how many of a state's latest results count; one variant for each",
    )
    parser.add_argument('--estimator', choices=sorted(ESTIMATORS), help='of failure rates')
    for name, kind, what in OVERRIDES:
        parser.add_argument('--' + name.replace('_', '-'), type=kind, metavar='X', help=what)
    parser.add_argument(
        '--answer-delay',
        metavar='S',
        type=float,
        default=15.0,
        help='s of simulated time that the scripted operator takes, in the median (default: 15)',
    )
    parser.add_argument('--benign', action='store_true', help='worlds without causes to fail')
    parser.add_argument(
        '--lasting',
        type=float,
        metavar='SHARE',
        help='of the causes, that last, 0 to 1 (default: that of the world)',
    )
    parser.add_argument(
        '--hours',
        type=float,
        metavar='H',
        help='of a world that goes on from trial to trial (default: each trial has a fresh one)',
    )
    parser.add_argument(
        '--extra-causes',
        action='store_true',
        help='one of two more kinds of causes in each trial, and none of the usual ones',
    )
    parser.add_argument(
        '--hung-after',
        type=float,
        default=HUNG_AFTER_S,
        metavar='S',
        help='after so many s without an event a trial is run again, and likewise after five times '
        'as many in all (default: {:.0f})'.format(HUNG_AFTER_S),
    )
    add_options(parser, 'runs the trials, each with a master and a world there')
    for option in ('--freeze', '--abandon-freeze'):  # as the frozen text of the protocol has them
        parser.add_argument(option, help=argparse.SUPPRESS)
    parser.add_argument(
        '--output',
        metavar='FOLDER',
        type=lambda text: Path(path_of(text)),
        help='folder: new, empty, or of this experiment, which goes on (default: trials-DATE-TIME)',
    )
    return parser


def parse(argv: Optional[List[str]]) -> argparse.Namespace:
    """Parse the command line. `args.plan` is the experiment.

    A wrong one ends the process, and so does an empty one.
    """
    parser = make_parser()
    given = sys.argv[1:] if argv is None else argv
    if not given:
        parser.error('name what to run: --task {}, for example'.format(DEFAULT_TASK))
    args = parser.parse_args(given)
    task = args.task or DEFAULT_TASK
    trials = TASKS[task].trials if args.trials is None else args.trials
    replicates = 1 if args.replicates is None else args.replicates
    for check, option, value in (
        (COUNT, '--trials', trials),
        (COUNT, '--jobs', args.jobs if args.jobs is not None else 1),
        (COUNT, '--replicates', replicates),
        (SEED, '--seed', args.seed),
        (SHARE, '--lasting', args.lasting),
        (HOURS, '--hours', args.hours),
        (DELAY, '--answer-delay', args.answer_delay),
    ):
        try:
            if value is not None:
                check(option, value)
        except SettingsError as err:
            parser.error('{} must be {}'.format(err.key, err.allowed))
    for name in ('benign', 'lasting', 'hours'):
        if args.extra_causes and getattr(args, name) != parser.get_default(name):
            parser.error('--extra-causes: not with --{}'.format(name))
    for name in ('lasting', 'hours'):
        if getattr(args, name) is not None and not TASKS[task].lock_step:
            parser.error(
                '--{}: the world of {} cannot do that; leave it out, or take another --task'.format(
                    name, task
                )
            )
    if args.freeze is not None and args.abandon_freeze is not None:
        parser.error('--abandon-freeze: not with --freeze')
    if args.without_tls and not args.scheduler:
        parser.error('--without-tls: name a --scheduler')
    if args.jobs is None and not args.scheduler:
        args.jobs = JOBS
    if not args.hung_after > 0:
        parser.error('--hung-after must be more than 0')
    settings = {
        name: getattr(args, name)
        for name in ['estimator'] + [name for name, _, _ in OVERRIDES]
        if getattr(args, name) is not None
    }
    variants = _chosen_variants(parser, args, settings)
    for variant in variants:
        try:
            Settings.from_dict(dict(variant.settings))
        except SettingsError as err:
            parser.error(str(err))
    args.plan = ExperimentPlan(
        task,
        trials,
        args.seed,
        replicates,
        variants,
        args.answer_delay,
        args.benign,
        args.lasting,
        args.hours,
        extra_causes=args.extra_causes,
    )
    args.names = [name for name in args.variants if name not in BOTH]  # of a protocol's variants
    _check_protocol(parser, args)
    return args


def _check_protocol(parser: argparse.ArgumentParser, args: argparse.Namespace) -> None:
    """Refuse what a protocol says itself, and what makes sense of a protocol alone."""
    if args.protocol:
        said = (
            'policy',
            'memory',
            'estimator',
            'benign',
            'lasting',
            'hours',
            'extra_causes',
            *(name for name, _, _ in OVERRIDES),
        )
        for name in said:
            if getattr(args, name) != parser.get_default(name):
                parser.error('--{}: the protocol says it'.format(name.replace('_', '-')))
        if args.variants != ['both'] and not args.names:
            parser.error('--variants: name those of the protocol')
    elif args.frozen:
        parser.error('--frozen: name a --protocol')


def _chosen_variants(
    parser: argparse.ArgumentParser, args: argparse.Namespace, settings: Mapping[str, Any]
) -> Tuple[Variant, ...]:
    by_oracle = [name for name in args.variants if name in BOTH]
    if not by_oracle:
        if args.policy != [CONFIGURED]:
            parser.error('--policy: name the policies by --variants')
        return named_variants(args.variants, settings, list(dict.fromkeys(args.memory or ())))
    if len(args.variants) > 1:
        parser.error('--variants: {} stands alone'.format(by_oracle[0]))
    return make_variants(by_oracle[0], settings, varied_settings(args))


def varied_settings(args: argparse.Namespace) -> Dict[str, Sequence[Any]]:
    """The settings of which each value has a variant of its own."""
    varied: Dict[str, Sequence[Any]] = {}
    if args.policy != [CONFIGURED]:
        varied['policy'] = list(dict.fromkeys(args.policy))
    if args.memory:
        varied['memory'] = list(dict.fromkeys(args.memory))
    return varied


def main(argv: Optional[List[str]] = None) -> int:
    """Entry point.

    :returns: 0, or 1 where a job failed, 3 where trials were lost, or 128 and the signal's number
        where one stopped it: 130 on Ctrl-C.
    """
    args = parse(argv)
    if args.freeze is not None or args.abandon_freeze is not None:
        return freeze_seeds(args)
    output = (args.output or Path(time.strftime('trials-%Y%m%d-%H%M%S'))).resolve()
    try:
        if output.is_file():
            raise ExperimentError('--output: {}: a file; allowed: a folder'.format(output))
        if args.only_plan:
            parts = chosen_parts(args) if args.protocol else [Part('', args.plan)]
            print(plan_text(parts, args.output, args.jobs or JOBS))
            print(limit_text(args.hung_after))
            return 0
        with contextlib.ExitStack() as closing:
            cluster = _cluster(args, closing)
            print(limit_text(args.hung_after))
            if args.protocol:
                with alone_in(output):
                    code, told = run_protocol(args, output, cluster)
                print(told)
                return code
            jobs = _run_in(output, args.plan, args, cluster)
    except ImportError as err:  # bags are read with a package that not every robot has
        print('run_trials: {}'.format(lacking(err) or err), file=sys.stderr)
        return LACKING
    except (ClusterError, ExperimentError, OSError) as err:
        print('run_trials: {}'.format(err), file=sys.stderr)
        return FAILED
    except StopRequested as err:
        print(
            'run_trials: stopped by {}; what was recorded stays in {}, and the same command with '
            '--output goes on '
            'there'.format(err, output),
            file=sys.stderr,
        )
        return 128 + err.signum
    return report(jobs, output)


def _cluster(args: argparse.Namespace, closing: contextlib.ExitStack) -> Optional[WorkerCluster]:
    """Return the cluster that runs the trials, None where this machine does, and set `args.jobs`.

    :raises ExperimentError: where roslaunch is not found that runs them.
    """
    if not args.scheduler:
        if shutil.which('roslaunch') is None:
            raise ExperimentError('roslaunch not found; source the workspace first')
        return None
    cluster = closing.enter_context(WorkerCluster(args.scheduler, args.without_tls))
    for facts in cluster.facts:
        if not facts.roslaunch:
            raise ExperimentError(
                'the worker on {} does not find roslaunch; start it in a shell that has sourced '
                'the workspace'.format(facts.host)
            )
    args.jobs = min(args.jobs or cluster.slots(), cluster.slots())
    return cluster


def _run_in(
    output: Path, plan: ExperimentPlan, args: argparse.Namespace, cluster: Optional[WorkerCluster]
) -> List[ExperimentJob]:
    with alone_in(output):
        if enter_folder(output, plan, args.hung_after):
            print('Going on in {}'.format(output))
        return run(plan, output, args.jobs, args.hung_after, cluster)


def limit_text(hung_after_s: float) -> str:
    """Return which trials are taken for hung, in words."""
    return 'A trial counts as hung after {:.0f} s without an event, or {:.0f} s in all.'.format(
        hung_after_s, LONGEST * hung_after_s
    )


def freeze_seeds(args: argparse.Namespace) -> int:
    """Freeze the protocol, or abandon the last freeze, and return the exit code."""
    abandons = args.freeze is None
    print(
        'run_trials: {} is now called {}'.format(
            *(('--abandon-freeze', FREEZING + ' --abandon') if abandons else ('--freeze', FREEZING))
        ),
        file=sys.stderr,
    )
    what = ABANDONED if abandons else FROZEN
    note = args.abandon_freeze if abandons else args.freeze
    try:
        print(run_freeze(checkout(), what, note))
    except (ExperimentError, OSError) as err:
        print('run_trials: {}'.format(err), file=sys.stderr)
        return FAILED
    return 0


def report(jobs: Sequence[ExperimentJob], output: Path) -> int:
    """Print the tables, draw the figures, name what was lost, and return the exit code."""
    places = [str(output / name) for name in dict.fromkeys(job.variant.name for job in jobs)]
    code = bag_statistics.main(
        places
        + [
            '--figure',
            str(output / 'time_series'),
            '--csv',
            str(output / 'trials.csv'),
            '--json',
            str(output / 'statistics.json'),
        ]
    )
    lost = [
        '{}: seed {}: {}'.format(job.name, seed, why)
        for job in jobs
        for seed, why in sorted(job.lost.items())
    ]
    if lost:
        print('Lost trials:\n  {}'.format('\n  '.join(lost)))
    print('Bags, logs and figures: {}'.format(os.fspath(output)))
    return code or (LOST if lost else 0)
