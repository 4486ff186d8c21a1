#!/usr/bin/env python3
"""SIGINT and SIGTERM at any time: the question is taken back, the bag closed, the process gone
within two seconds.
"""

import glob
import json
import os
import signal
import sys
import tempfile
import time
import unittest
from functools import partial
from typing import Callable, Dict, List, Optional, Tuple

import rospy
from oracle_support import (
    SIGNALS,
    FrontEnd,
    OwnMaster,
    Process,
    oracle_run,
    recorded_events,
    script,
)
from waiting import END_LIMIT_S

from smach_oracle.msg import OracleEvent

# a limit on time holds if it holds once: what else the machine does can only make a program slower
ATTEMPTS = 3
TASK = """
import sys, time, rospy, smach, smach_ros
rospy.init_node('task')
place = sys.argv[1]
def note(text):
    print(text, flush=True)
class Pick(smach.State):
    def __init__(self):
        smach.State.__init__(self, outcomes=['succeeded', 'aborted', 'preempted'])
    def execute(self, userdata):
        if place in ('query', 'precondition'):
            return 'aborted'
        if place == 'between_trials':
            return 'succeeded'
        note('THERE')
        while place == 'state_that_never_returns' or not self.preempt_requested():
            time.sleep(0.05)
        self.service_preempt()
        return 'preempted'
class Prepare(smach.State):
    def __init__(self):
        smach.State.__init__(self, outcomes=['succeeded', 'preempted'])
    def execute(self, userdata):
        note('THERE')
        while not self.preempt_requested():
            time.sleep(0.05)
        self.service_preempt()
        return 'preempted'
sm = smach.StateMachine(outcomes=['succeeded', 'aborted', 'preempted'])
with sm:
    smach.StateMachine.add('PICK', Pick())
    smach.StateMachine.add('PREPARE', Prepare(), {'succeeded': 'PICK'})
"""
RUN = """
note('OUTCOME %s' % sm.execute())
if place == 'between_trials':
    note('THERE')
    time.sleep(60)
"""
IN_A_THREAD = """
import threading
runner = threading.Thread(target=lambda: note('OUTCOME %s' % sm.execute()))
runner.start()
rospy.spin()
runner.join()
"""
LIBRARY = """
from smach_oracle import OracleContainer
settings = {'max_recoveries': 0, 'expert': {'deadline_s': 0}}
sm = OracleContainer.wrap(sm, settings=settings, name='TASK')
"""


class TooSlow(AssertionError):
    """A process has not ended in time."""


class SignalsTest(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.bags = folder.name

    def start(
        self, place: str, text: str = TASK + RUN, settings: Optional[Dict[str, object]] = None
    ) -> Process:
        config = script(
            self, json.dumps(dict({'expert': {'deadline_s': 0}}, **(settings or {}))), 'oracle.yaml'
        )
        task = oracle_run(
            self, '--config', config, '--record', self.bags, script(self, text), place
        )
        if place == 'query':
            self.assertIsNotNone(FrontEnd(self, '/task/expert_query').question(), task.output())
        else:
            self.assertTrue(task.says('THERE'), task.output())
        return task

    def in_time(self, case: Callable[[], None]) -> None:
        """Run a case in a folder of its own, again where a process in it was too slow; any other
        failure counts.
        """
        for attempt in range(1, ATTEMPTS + 1):
            self.setUp()
            try:
                return case()
            except TooSlow as err:
                if attempt == ATTEMPTS:
                    raise
                print('too slow, tried again: {}'.format(err), flush=True)

    def signalled(self, task: Process, number: int) -> int:
        """Send the signal; its exit code. Raises TooSlow."""
        sent = time.monotonic()
        task.signal(number)
        code = task.wait(30.0)
        took_s = time.monotonic() - sent
        if took_s > END_LIMIT_S:
            raise TooSlow('{:.1f} s\n{}'.format(took_s, task.output()))
        return code

    def end(self, task: Process, number: int) -> Tuple[int, List[OracleEvent]]:
        """Send the signal; check that it ends in time with its bag closed. Exit code and recorded
        events.
        """
        code = self.signalled(task, number)
        self.assertEqual(glob.glob(os.path.join(self.bags, '*.active')), [], task.output())
        (events,) = recorded_events(self.bags)
        return code, events

    def with_each_signal(self, case: Callable[[int], None]) -> None:
        for number in SIGNALS:
            with self.subTest(signal=signal.Signals(number).name):
                self.in_time(partial(case, number))

    def check_preempted(
        self, place: str, text: str = TASK + RUN, expected: Optional[int] = None, **settings: object
    ) -> None:
        def case(number: int) -> None:
            task = self.start(place, text, settings)
            code, events = self.end(task, number)
            self.assertIn('OUTCOME preempted', task.output())
            self.assertEqual(code, 0, task.output())
            self.assertEqual(
                (events[-1].kind, events[-1].outcome), (OracleEvent.TRIAL_END, 'preempted')
            )
            if expected is not None:
                self.assertIn(expected, [event.kind for event in events])

        self.with_each_signal(case)

    def test_in_a_state(self) -> None:
        self.check_preempted('state')

    def test_in_a_state_of_a_machine_that_runs_in_a_thread(self) -> None:
        self.check_preempted('state', TASK + IN_A_THREAD)

    def test_in_a_precondition(self) -> None:
        self.check_preempted(
            'precondition',
            expected=OracleEvent.PRECONDITION_START,
            states={'PICK': {'preconditions': ['PREPARE']}},
        )

    def test_in_a_question(self) -> None:
        self.check_preempted('query', expected=OracleEvent.QUERY_CANCELLED, max_recoveries=0)

    def test_in_a_state_that_never_returns(self) -> None:
        def case(number: int) -> None:
            code, events = self.end(self.start('state_that_never_returns'), number)
            self.assertEqual(code, 128 + number)
            self.assertEqual(events[-1].kind, OracleEvent.STATE_START)

        self.with_each_signal(case)

    def test_between_trials(self) -> None:
        def case(number: int) -> None:
            code, events = self.end(self.start('between_trials'), number)
            self.assertEqual(code, 128 + number)
            self.assertEqual(events[-1].kind, OracleEvent.TRIAL_END)

        self.with_each_signal(case)

    def test_in_a_program_that_uses_the_library_itself(self) -> None:
        self.in_time(self.library_case)

    def library_case(self) -> None:
        rospy.set_param('/task/record', self.bags)
        self.addCleanup(
            lambda: rospy.has_param('/task/record') and rospy.delete_param('/task/record')
        )
        program = Process([sys.executable, script(self, TASK + LIBRARY + RUN), 'query'])
        self.addCleanup(program.stop)
        front_end = FrontEnd(self, '/task/expert_query')
        self.assertIsNotNone(front_end.question(), program.output())
        code, events = self.end(program, signal.SIGINT)
        self.assertEqual(code, 0)
        self.assertIn('OUTCOME preempted', program.output())
        self.assertIn(OracleEvent.QUERY_CANCELLED, [event.kind for event in events])

    def test_while_the_master_hangs(self) -> None:
        self.in_time(self.hanging_master_case)

    def hanging_master_case(self) -> None:
        master = OwnMaster(self)
        task = oracle_run(
            self, '--record', self.bags, script(self, TASK + RUN), 'state', env=master.env
        )
        self.assertTrue(task.says('THERE'), task.output())
        master.hang()
        _, events = self.end(task, signal.SIGINT)
        self.assertIn(OracleEvent.STATE_START, [event.kind for event in events])

    def test_before_the_script_has_a_node(self) -> None:
        def case() -> None:
            task = oracle_run(
                self, script(self, "import time; print('THERE', flush=True); time.sleep(60)")
            )
            self.assertTrue(task.says('THERE'), task.output())
            self.assertEqual(self.signalled(task, signal.SIGTERM), 128 + signal.SIGTERM)

        self.in_time(case)


if __name__ == '__main__':
    import rostest

    rospy.init_node('fault_signals')
    rostest.rosrun('smach_oracle', 'fault_signals', SignalsTest, sys.argv)
