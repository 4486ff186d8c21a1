"""A program that meets SIGINT or SIGTERM around its first execute: bare, wrapped, under oracle_run.

Shared by the rostest and the benchmark of signals. The signals come from the first execute on. What
a program has imported by then is imported once: the programs are forked from such interpreters.
"""

import glob
import json
import os
import random
import signal
import tempfile
import time
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, suppress
from typing import Any, Callable, List, NamedTuple, Optional, Sequence

import rosbag
from oracle_support import RUNNER
from waiting import wait_for
from warm_python import ORACLE_RUN, WarmPython

# of programs, and what is imported before beside ROS's libraries
KINDS = {
    'bare': ('smach', 'smach_ros'),
    'library': ('smach', 'smach_ros', 'smach_oracle', 'smach_oracle.ros.container'),
    'oracle_run': ('smach', 'smach_ros', *ORACLE_RUN),
}
START_S = 60.0  # it may take until its first execute
LONGEST_DELAY_S = 1.0  # what the first execute sets up takes less on a machine that is not busy
HUNG_AFTER_S = 20.0
TASK = """
import faulthandler, os, signal, sys, time, rospy, smach, smach_ros
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
# the link appears at once with the number of the process in it
RUN = """
os.symlink(str(os.getpid()), os.path.join(os.path.dirname(__file__), 'ready'))
print('OUTCOME {}'.format(sm.execute()), flush=True)
"""


class Ending(NamedTuple):
    """What one signal did."""

    kind: str
    number: int  # the signal's
    delay_s: float  # from its first execute
    code: Optional[int]  # None where the process hung
    took_s: float
    broken_bags: List[str]  # why each bag that is not whole is not
    output: str


def signal_many(
    count: int,
    seed: int,
    kinds: Sequence[str] = tuple(KINDS),
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
    with ExitStack() as opened:
        pythons = {kind: WarmPython(*KINDS[kind]) for kind in kinds}
        for python in pythons.values():
            opened.callback(python.close)
        pool = opened.enter_context(ThreadPoolExecutor(at_once))
        for ending in pool.map(lambda case: _signalled(pythons[case[0]], *case), cases):
            endings.append(ending)
            told(ending)
    return endings


def _signalled(python: WarmPython, kind: str, number: int, delay_s: float, node: str) -> Ending:
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(1) as pool:
        bags, ready = os.path.join(folder, 'bags'), os.path.join(folder, 'ready')
        command = _command(kind, folder, bags) + ['__name:=' + node]
        # it is killed here where it hangs
        program = pool.submit(python.run, command, START_S + LONGEST_DELAY_S + 2 * HUNG_AFTER_S)
        wait_for(lambda: program.done() or os.path.islink(ready), START_S)
        if not os.path.islink(ready):
            raise RuntimeError('it did not start: {}'.format(program.result()))
        process = int(os.readlink(ready))
        time.sleep(delay_s)  # the instant itself is what is tried
        begun_s = time.monotonic()
        with suppress(ProcessLookupError):  # it has ended by itself
            os.kill(process, number)
        hung = not wait_for(program.done, HUNG_AFTER_S)
        took_s = time.monotonic() - begun_s
        if hung:
            _end(process, program)
        ended = program.result()
        code = None if hung else ended.returncode
        output = ended.stdout + ended.stderr
        return Ending(kind, number, delay_s, code, took_s, _broken(bags), output)


def _command(kind: str, folder: str, bags: str) -> List[str]:
    path = os.path.join(folder, 'task.py')
    with open(path, 'w') as file:
        file.write(TASK + (LIBRARY if kind == 'library' else '') + RUN)
    if kind == 'oracle_run':
        settings = os.path.join(folder, 'oracle.yaml')
        with open(settings, 'w') as file:
            json.dump(SETTINGS, file)
        return ['-c', RUNNER, '--config', settings, '--record', bags, path]
    return [path, '_record:=' + bags]


def _end(process: int, program: 'Future[Any]') -> None:
    """Let a process that hangs print the stacks of its threads, and kill it."""
    with suppress(ProcessLookupError):
        os.kill(process, signal.SIGUSR1)
        time.sleep(0.5)  # they come without an end to be known
        os.kill(process, signal.SIGKILL)


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
