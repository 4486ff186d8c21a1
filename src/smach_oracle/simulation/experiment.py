"""Run an experiment: the same seeds with and without the oracle, every trial recorded, counted at the end.

Each arm has its own ROS master on a free port; what is started is stopped, also on Ctrl-C, pressed once or often.
"""
import argparse
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from types import FrameType
from typing import Any, Dict, IO, List, Optional

from smach_oracle.analysis import bag_statistics
from smach_oracle.oracle.policy import POLICIES

TASKS = {'pick_and_place': 'pick_and_place.launch'}
ARMS = {'with': 'with_oracle', 'without': 'without_oracle'}
POLL_S = 0.5
NODE_STOP = ['--sigint-timeout', '5', '--sigterm-timeout', '2']  # s, before roslaunch kills a node that does not end
STOP_S = 30.0  # for roslaunch to do so with the nodes, rosout and the master, one after the other
STALL_S = 300.0  # without a finished trial: the arm is hung


class ExperimentError(Exception):
    """An arm could not be run; the text says which, why and where its log is."""


class Interrupted(Exception):
    """A signal asked to stop."""

    def __init__(self, signum: int) -> None:
        super().__init__(signal.Signals(signum).name)
        self.signum = signum


class Interrupts:
    """``with Interrupts() as interrupts:`` signals that ask to stop are noted there, for `check` to raise.

    So they cannot tear apart the starting and the stopping of the arms, and the second Ctrl-C of somebody impatient
    does not leave robots running that the first one was about to stop.
    """

    SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

    def __init__(self) -> None:
        self._came: Optional[int] = None
        self._before: Dict[int, Any] = {}

    def __enter__(self) -> 'Interrupts':
        self._before = {signum: signal.signal(signum, self._note) for signum in self.SIGNALS}
        return self

    def __exit__(self, *_: object) -> None:
        for signum, handler in self._before.items():
            signal.signal(signum, handler)

    def _note(self, signum: int, _: Optional[FrameType]) -> None:
        self._came = self._came or signum

    def check(self) -> None:
        """Raise Interrupted if a signal came."""
        if self._came:
            raise Interrupted(self._came)


class Arm:
    """One arm of the experiment: a roslaunch of its own, with a master of its own."""

    def __init__(self, name: str, args: argparse.Namespace, output: Path) -> None:
        self.name = name
        self.trials = args.trials
        self.bags = output / ARMS[name]
        self.log = output / '{}.log'.format(ARMS[name])
        self.bags.mkdir(parents=True)
        self.started = time.monotonic()
        self._last_progress = (0, self.started)
        self._log_file: IO[str] = self.log.open('w')
        self._process = subprocess.Popen(self._command(args), env=self._environment(output),
                                         stdout=self._log_file, stderr=subprocess.STDOUT, start_new_session=True)

    def _command(self, args: argparse.Namespace) -> List[str]:
        self._port = free_port()
        settings = {'trials': args.trials, 'seed': args.seed, 'record': self.bags,
                    'with_oracle': str(self.name == 'with').lower(), 'answer_delay': args.answer_delay,
                    'policy': args.policy}
        return (['roslaunch', *NODE_STOP, '--port', str(self._port), 'smach_oracle', TASKS[args.task]]
                + ['{}:={}'.format(key, value) for key, value in settings.items()])

    def _environment(self, output: Path) -> Dict[str, str]:
        return dict(os.environ, ROS_MASTER_URI='http://localhost:{}'.format(self._port), ROS_HOSTNAME='localhost',
                    ROS_LOG_DIR=str(output / 'log' / ARMS[self.name]), PYTHONUNBUFFERED='1')

    def finished_trials(self) -> int:
        """How many bags are complete."""
        return sum(1 for _ in self.bags.glob('*.bag'))

    def running(self) -> bool:
        """Whether the launch still runs.

        :raises ExperimentError: where it ended with trials missing, or no trial has ended for too long.
        """
        done = self.finished_trials()
        now = time.monotonic()
        if done > self._last_progress[0]:
            self._last_progress = (done, now)
        if self._process.poll() is None:
            if now - self._last_progress[1] > STALL_S:
                raise ExperimentError('{}: no trial has ended for {:.0f} s; see {}'.format(
                    ARMS[self.name], STALL_S, self.log))
            return True
        if done < self.trials:
            raise ExperimentError('{}: ended after {} of {} trials; see {}'.format(
                ARMS[self.name], done, self.trials, self.log))
        return False

    def request_stop(self) -> None:
        """Ask the launch to end with all its nodes."""
        if self._process.poll() is None:
            os.killpg(self._process.pid, signal.SIGINT)

    def stop(self) -> None:
        """End the launch and all its nodes."""
        self.request_stop()
        try:
            self._process.wait(STOP_S)
        except subprocess.TimeoutExpired:
            nodes = children_of(self._process.pid)  # each in a group of its own
            for group in [self._process.pid] + nodes:
                try:
                    os.killpg(group, signal.SIGKILL)
                except ProcessLookupError:
                    pass  # it has ended meanwhile
            self._process.wait()
        self._log_file.close()


def children_of(pid: int) -> List[int]:
    """Processes whose parent it is."""
    found = []
    for stat in Path('/proc').glob('[0-9]*/stat'):
        try:
            parent = int(stat.read_text().rpartition(')')[2].split()[1])
        except OSError:
            continue  # it has ended meanwhile
        if parent == pid:
            found.append(int(stat.parent.name))
    return found


def free_port() -> int:
    """A TCP port of the loopback interface that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(('localhost', 0))
        return int(probe.getsockname()[1])


class Progress:
    """One line that is rewritten on a terminal, a line now and then elsewhere."""

    def __init__(self, stream: IO[str]) -> None:
        self._stream = stream
        self._terminal = stream.isatty()
        self._last = ''
        self._printed = 0.0

    def show(self, arms: List[Arm]) -> None:
        """Trials done so far and time left."""
        text = '   '.join(describe(arm) for arm in arms)
        now = time.monotonic()
        if text == self._last or (not self._terminal and now - self._printed < 10.0):
            return
        self._last, self._printed = text, now
        self._stream.write('\r\033[K' + text if self._terminal else text + '\n')
        self._stream.flush()

    def end(self) -> None:
        """Leave the line."""
        if self._terminal:
            self._stream.write('\n')


def describe(arm: Arm) -> str:
    """E.g. "with oracle 40/150, 12 s left"."""
    done = arm.finished_trials()
    left = ''
    if 0 < done < arm.trials:
        left = ', {:.0f} s left'.format((time.monotonic() - arm.started) / done * (arm.trials - done))
    return '{} {}/{}{}'.format(ARMS[arm.name].replace('_', ' '), done, arm.trials, left)


def run(args: argparse.Namespace, output: Path) -> None:
    """Run the arms, at most `jobs` at a time.

    :raises ExperimentError: naming the arm and its log.
    :raises Interrupted: by Ctrl-C and the like, once everything is stopped.
    """
    arms: List[Arm] = []
    progress = Progress(sys.stdout)
    with Interrupts() as interrupts:
        try:
            run_arms(args, output, arms, interrupts, progress)
        finally:
            progress.end()
            for arm in arms:
                arm.request_stop()
            for arm in arms:
                arm.stop()


def run_arms(args: argparse.Namespace, output: Path, arms: List[Arm], interrupts: Interrupts,
             progress: Progress) -> None:
    """Start the arms, adding each to `arms`, and wait for their ends."""
    waiting = list(ARMS) if args.arms == 'both' else [args.arms]
    active: List[Arm] = []
    while waiting or active:
        while waiting and len(active) < args.jobs:
            active.append(Arm(waiting.pop(0), args, output))
            arms.append(active[-1])
        time.sleep(POLL_S)
        interrupts.check()
        active = [arm for arm in active if arm.running()]
        progress.show(arms)


def parse(argv: Optional[List[str]]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--task', choices=sorted(TASKS), default='pick_and_place', help='(default: %(default)s)')
    parser.add_argument('--trials', type=int, default=150, help='per arm (default: %(default)s, as in the paper)')
    parser.add_argument('--seed', type=int, default=1, help='of the first trial; the next has the next (default: 1)')
    parser.add_argument('--jobs', type=int, default=2, help='arms at a time (default: %(default)s)')
    parser.add_argument('--arms', choices=['both'] + sorted(ARMS), default='both', help='(default: %(default)s)')
    parser.add_argument('--policy', choices=['configured'] + sorted(POLICIES), default='configured',
                        help="instead of the task's own, which is as configured (default)")
    parser.add_argument('--answer-delay', type=float, default=0.0, help='s that the scripted expert takes')
    parser.add_argument('--output', type=Path, help='new or empty folder (default: trials-DATE-TIME)')
    args = parser.parse_args(argv)
    if args.trials < 1 or args.jobs < 1 or args.seed < 0 or not 0.0 <= args.answer_delay < 3600.0:
        parser.error('--trials and --jobs must be 1 or more, --seed and --answer-delay 0 or more')
    return args


def prepare(output: Optional[Path]) -> Path:
    """The folder for the results, which must not hold any yet."""
    folder = output or Path(time.strftime('trials-%Y%m%d-%H%M%S'))
    if folder.exists() and any(folder.iterdir()):
        raise ExperimentError('{}: not empty; recorded trials are never overwritten'.format(folder))
    folder.mkdir(parents=True, exist_ok=True)
    return folder.resolve()


def main(argv: Optional[List[str]] = None) -> int:
    """Entry point.

    :returns: 0, or 1 where an arm failed, or 128 and the signal's number where one stopped it: 130 on Ctrl-C.
    """
    args = parse(argv)
    try:
        if shutil.which('roslaunch') is None:
            raise ExperimentError('roslaunch not found; source the workspace first')
        output = prepare(args.output)
        run(args, output)
    except (ExperimentError, OSError) as err:
        print('run_trials: {}'.format(err), file=sys.stderr)
        return 1
    except Interrupted as err:
        print('run_trials: stopped by {}; what was recorded stays in {}'.format(err, output), file=sys.stderr)
        return 128 + err.signum
    code = bag_statistics.main([str(output), '--figure', str(output / 'time_series')])
    print('\nThe failures of this world are drawn from a fault model: these figures show that the pipeline works, '
          'they say nothing of the paper\'s claim.\nBags, logs and figures: {}'.format(output))
    return code
