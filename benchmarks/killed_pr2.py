#!/usr/bin/env python3
"""The simulated PR2, whose executive is killed in the middle of a trial: is the trial worse for it?

    python3 benchmarks/killed_pr2.py [--task TASK] [--trials N] [--seed S] [--instants I]

Each seed has two trials, in a world that is reset before each. One runs undisturbed. In the other
the executive is killed by SIGKILL, and started again at once with ``--resume``. World, robot and
scripted operator go on meanwhile. The instant is drawn evenly from the time that the undisturbed
trial took. Where the trial ends before it, a new one begins with half of that time. Rates are not
carried from trial to trial.

A trial is worse where it ended in true success undisturbed, by the judge of the world, and did not
when killed. At most one trial in fifty may be worse, and none may hang. Otherwise the exit status
is 1. Seeds below 1000 are those that the robot was tuned on.
"""

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import List, NamedTuple, Optional

from smach_oracle.experiment.launching import LOG_FILE, Launch, last_words
from smach_oracle.store.rows import StoredMoment
from smach_oracle.store.store_file import StoreFile

ROOT = Path(__file__).resolve().parents[1]
ROSTESTS = ROOT / 'test' / 'rostest'
TASKS = ('pick_and_place', 'drink_retrieval')
READY_S = 180.0  # wall s, for the world and its robot
LONGEST_S = 900.0  # wall s, of a trial: it hangs
END_S = 30.0  # wall s, for an executive that has told its outcome
WORSE_SHARE = 0.02
READY = 'until rosservice list | grep -q /world/reset; do sleep 1; done'
HEAD = '{:>6} {:>12} {:>12} {:>9} {:>9}  {}'


class Ended(NamedTuple):
    """The end of a trial."""

    outcome: str  # of the machine; 'hung' where it did not end
    success: bool  # by the judge of the world
    questions: int
    took_s: float  # wall s, from the beginning of the machine
    killed_in: str  # path of the state that was under way; '' where it was not killed
    why: str  # the judge's reason


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument('--task', choices=TASKS, nargs='+', default=TASKS, help='(default: both)')
    parser.add_argument('--trials', type=int, default=50, help='of each (default: %(default)s)')
    parser.add_argument('--seed', type=int, default=1, help='of the first (default: %(default)s)')
    parser.add_argument(
        '--instants', type=int, default=1, help='seed of the instants (default: %(default)s)'
    )
    options = parser.parse_args()
    if options.trials < 1 or options.seed < 0:
        parser.error('--trials must be 1 or more and --seed 0 or more')
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # so that no program is left
    return int(any([kill_in_task(task, options) for task in options.task]))


def kill_in_task(task: str, options: argparse.Namespace) -> bool:
    """Run the trials of one task, print a line for each, and return whether too much is wrong."""
    chance = random.Random('{} {}'.format(options.instants, task))
    worse: List[int] = []
    better = hung = asked = asked_undisturbed = 0
    print('\n' + task, flush=True)
    print(HEAD.format('seed', 'undisturbed', 'killed', 'at s', 'questions', 'killed in'))
    with tempfile.TemporaryDirectory() as folder:
        robot = RobotUnderKills(folder, task)
        try:
            robot.wait_until_ready()
            for seed in range(options.seed, options.seed + options.trials):
                undisturbed = robot.run_trial(seed)
                instant, killed = chance.random() * undisturbed.took_s, None
                while killed is None or not killed.killed_in:
                    killed = robot.run_trial(seed, kill_at_s=instant)
                    at, instant = instant, instant / 2
                if undisturbed.success and not killed.success:
                    worse.append(seed)
                better += killed.success and not undisturbed.success
                hung += 'hung' in (undisturbed.outcome, killed.outcome)
                asked += killed.questions
                asked_undisturbed += undisturbed.questions
                print(
                    HEAD.format(
                        seed,
                        told(undisturbed),
                        told(killed),
                        round(at, 1),
                        '{} -> {}'.format(undisturbed.questions, killed.questions),
                        killed.killed_in + ('' if killed.success else ': ' + killed.why),
                    ),
                    flush=True,
                )
        finally:
            robot.stop()
    print(
        '{}: {} trials, worse: {} {}, better: {}, hung: {}, '
        'questions: {} undisturbed, {} killed'.format(
            task, options.trials, len(worse), worse or '', better, hung, asked_undisturbed, asked
        ),
        flush=True,
    )
    return bool(hung) or len(worse) > WORSE_SHARE * options.trials


def told(ended: Ended) -> str:
    """A trial's end in a word."""
    if ended.success:
        return 'success'
    return 'false' if ended.outcome == 'succeeded' else ended.outcome


class RobotUnderKills:
    """A PR2 in its world, with a master of its own, and one executive after the other."""

    def __init__(self, folder: str, task: str) -> None:
        self._folder, self._task = folder, task
        self._truth = os.path.join(folder, 'truth.jsonl')
        self._store = os.path.join(folder, 'robot.db')
        self._journal = os.path.join(folder, 'journal')
        self._launch = Launch(Path(folder), 'pr2.launch', {'task': task, 'truth': self._truth})

    def wait_until_ready(self) -> None:
        """Wait until the world is there.

        :raises SystemExit: where it does not come.
        """
        ready = subprocess.run(
            ['timeout', str(READY_S), 'bash', '-c', READY],
            env=self._launch.environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        if ready.returncode:
            raise SystemExit(
                'killed_pr2: no world:' + last_words(Path(self._folder) / LOG_FILE, 20)
            )

    def stop(self) -> None:
        """End all that was started."""
        self._launch.stop()

    def run_trial(self, seed: int, kill_at_s: Optional[float] = None) -> Ended:
        """Run one trial; kill its executive so many s after its beginning, where that is given."""
        self._reset(seed)
        for name in os.listdir(self._folder):
            if name.startswith(('journal', 'robot.db')):
                os.remove(os.path.join(self._folder, name))
        executive = self._execute()
        began_s = self._wait_for('begun', READY_S)
        killed_in = ''
        if kill_at_s is not None and self._wait_for('ended', kill_at_s) is None:
            executive.kill()
            executive.wait()
            if self._told('ended') is None:
                killed_in = self._under_way()
                executive = self._execute('--resume')
        ended_s = None if began_s is None else self._wait_for('ended', LONGEST_S)
        outcome = self._told('ended') or 'hung'
        try:
            executive.wait(0.0 if ended_s is None else END_S)
        except subprocess.TimeoutExpired:
            executive.kill()
            executive.wait()
        questions = sum(moment.kind == 'QUERY_OPENED' for moment in self._moments())
        self._reset(seed)  # the world judges a trial where the next one begins
        with open(self._truth) as stream:
            truth = json.loads(stream.readlines()[-1])
        if truth['seed'] != seed:
            raise RuntimeError('the world told of seed {seed} last'.format(**truth))
        return Ended(
            outcome,
            truth['success'],
            questions,
            (ended_s or 0.0) - (began_s or 0.0),
            killed_in,
            truth['why'],
        )

    def _reset(self, seed: int) -> None:
        answer = subprocess.run(
            ['rosservice', 'call', '/world/reset', 'seed: {}'.format(seed)],
            env=self._launch.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        )
        if b'ok: True' not in answer.stdout:
            raise RuntimeError('world/reset: ' + answer.stdout.decode())

    def _execute(self, *words: str) -> subprocess.Popen:
        """Start the executive."""
        with open(os.path.join(self._folder, 'executive.log'), 'a') as log:
            return subprocess.Popen(
                [
                    sys.executable,
                    str(ROOT / 'scripts' / 'oracle_run'),
                    '--config',
                    str(ROOT / 'src' / 'smach_oracle' / 'tasks' / (self._task + '.yaml')),
                    '--name',
                    self._task.upper(),
                    '--checkpoint',
                    self._store,
                    *words,
                    str(ROSTESTS / 'killed_pr2_robot.py'),
                    self._task,
                    self._journal,
                    '__name:=' + self._task,
                    '_pass_time:=/world/pass_time',
                ],
                env=self._launch.environment,
                stdout=log,
                stderr=subprocess.STDOUT,
            )

    def _told(self, word: str) -> Optional[str]:
        """Return what stands behind a word in the journal; None where it is not there."""
        try:
            with open(self._journal) as stream:
                lines = [line.split() for line in stream]
        except FileNotFoundError:
            return None
        return next((' '.join(line[1:]) for line in lines if line[0] == word), None)

    def _wait_for(self, word: str, limit_s: float) -> Optional[float]:
        """Return when a word came (s of time.monotonic()); None where it does not."""
        until = time.monotonic() + limit_s
        while self._told(word) is None:
            if time.monotonic() > until:
                return None
            time.sleep(0.02)
        return time.monotonic()

    def _moments(self) -> List[StoredMoment]:
        if not os.path.exists(self._store):
            return []  # it was killed before that
        store = StoreFile(self._store, read_only=True)
        return [moment for trial in store.trials() for moment in store.moments(trial.number)]

    def _under_way(self) -> str:
        """Return the last state that the store names."""
        labels = [moment.label for moment in self._moments() if moment.label]
        return labels[-1] if labels else 'no state yet'


if __name__ == '__main__':
    sys.exit(main())
