"""A program that meets SIGINT or SIGTERM around its first execute: bare, wrapped, under oracle_run.

Shared by the rostest and the benchmark of signals.
"""

import glob
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Callable, List, NamedTuple, Optional, Sequence

import rosbag
from oracle_support import RUNNER, Process

KINDS = ('bare', 'library', 'oracle_run')
LONGEST_DELAY_S = 1.0  # what the first execute sets up takes less on a machine that is not busy
HUNG_AFTER_S = 20.0
TASK = """
import faulthandler, signal, sys, time, rospy, smach, smach_ros
faulthandler.register(signal.SIGUSR1)
rospy.init_node('task')
class Work(smach.State):
    def __init__(self):
        smach.State.__init__(self, outcomes=['succeeded', 'aborted', 'preempted'])
        self.visits = 0
    def execute(self, userdata):
        self.visits += 1
        for _ in range(20):
            if self.preempt_requested():
                self.service_preempt()
                return 'preempted'
            time.sleep(0.01)
        return 'aborted' if self.visits % 2 else 'succeeded'
sm = smach.StateMachine(outcomes=['succeeded', 'aborted', 'preempted'])
with sm:
    smach.StateMachine.add('WORK', Work(), {'succeeded': 'WORK', 'aborted': 'WORK'})
"""
# the oracle takes the failures for which the script has a transition
SETTINGS = {'author_recoveries': 'override', 'max_recoveries': 1000}
LIBRARY = """
SETTINGS = {!r}
from smach_oracle import OracleContainer
OracleContainer.wrap(sm, settings=SETTINGS, name='TASK')
""".format(SETTINGS)
RUN = """
print('READY', flush=True)
print('OUTCOME {}'.format(sm.execute()), flush=True)
"""


class Ending(NamedTuple):
    """What one signal did."""

    kind: str
    number: int  # the signal's
    delay_s: float  # from READY
    code: Optional[int]  # None where the process hung
    took_s: float
    broken_bags: List[str]  # why each bag that is not whole is not
    output: str


def signal_many(
    count: int,
    seed: int,
    kinds: Sequence[str] = KINDS,
    at_once: int = 4,
    told: Callable[[Ending], Any] = lambda ending: None,
) -> List[Ending]:
    """Send `count` signals to processes of each kind, at instants drawn from a seed."""
    draw = random.Random(seed)
    cases = [
        (
            kind,
            number % 2 and signal.SIGTERM or signal.SIGINT,
            draw.uniform(0.0, LONGEST_DELAY_S),
            '{}_{}'.format(kind, number),
        )
        for number in range(count)
        for kind in kinds
    ]
    endings = []
    with ThreadPoolExecutor(at_once) as pool:
        for ending in pool.map(lambda case: _signalled(*case), cases):
            endings.append(ending)
            told(ending)
    return endings


def _signalled(kind: str, number: int, delay_s: float, node: str) -> Ending:
    with tempfile.TemporaryDirectory() as folder:
        bags = os.path.join(folder, 'bags')
        program = Process(_command(kind, folder, bags) + ['__name:=' + node])
        try:
            if not program.says('READY', 60.0):
                raise RuntimeError('it did not start: ' + program.output())
            time.sleep(delay_s)  # the instant itself is what is tried
            begun_s = time.monotonic()
            program.signal(number)
            code = _code(program)
            if code is None:
                _say_where(program)
            return Ending(
                kind,
                number,
                delay_s,
                code,
                time.monotonic() - begun_s,
                _broken(bags),
                program.output(),
            )
        finally:
            program.stop()


def _command(kind: str, folder: str, bags: str) -> List[str]:
    path = os.path.join(folder, 'task.py')
    with open(path, 'w') as file:
        file.write(TASK + (LIBRARY if kind == 'library' else '') + RUN)
    if kind == 'oracle_run':
        settings = os.path.join(folder, 'oracle.yaml')
        with open(settings, 'w') as file:
            json.dump(SETTINGS, file)
        return [sys.executable, '-c', RUNNER, '--config', settings, '--record', bags, path]
    return [sys.executable, path, '_record:=' + bags]


def _code(program: Process) -> Optional[int]:
    try:
        return program.wait(HUNG_AFTER_S)
    except subprocess.TimeoutExpired:
        return None


def _say_where(program: Process) -> None:
    """Let a process that hangs print the stacks of its threads."""
    program.signal(signal.SIGUSR1)
    program.says('most recent call first', 5.0)
    time.sleep(0.5)  # the rest of them comes without an end to be known


def _broken(folder: str) -> List[str]:
    wrong = [
        '{} is not closed'.format(path) for path in glob.glob(os.path.join(folder, '*.active'))
    ]
    for path in glob.glob(os.path.join(folder, '*.bag')):
        try:
            with rosbag.Bag(path) as bag:
                list(bag.read_messages())
        except Exception as err:
            wrong.append('{}: {!r}'.format(path, err))
    return wrong
