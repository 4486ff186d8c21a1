#!/usr/bin/env python3
"""The process of a wrapped program ends when its script has, and its bag tells how the trial ended.

In library use and under oracle_run; after success, failure, exception, preempt and SIGINT.
"""

import json
import signal
import sys
import tempfile
import unittest
from typing import List, Tuple

import rospy
from oracle_support import Process, oracle_run, recorded_events, script

from smach_oracle.msg import OracleEvent

TASK = """
import sys, threading, time, rospy, smach, smach_ros
rospy.init_node('task')
how = sys.argv[1]
class Work(smach.State):
    def __init__(self):
        smach.State.__init__(self, outcomes=['succeeded', 'aborted', 'preempted'])
    def execute(self, userdata):
        print('THERE', flush=True)
        if how == 'raises':
            raise RuntimeError('the gripper is not calibrated')
        while how in ('preempted', 'signalled'):
            if self.preempt_requested():
                self.service_preempt()
                return 'preempted'
            time.sleep(0.01)
        return 'aborted' if how == 'fails' else 'succeeded'
def outer():
    sm = smach.StateMachine(outcomes=['succeeded', 'aborted', 'preempted'])
    inner = smach.StateMachine(outcomes=['succeeded', 'aborted', 'preempted'])
    with inner:
        smach.StateMachine.add('WORK', Work())
    with sm:
        smach.StateMachine.add('INNER', inner)
    return sm
sm = outer()
if how == 'preempted':
    threading.Timer(1.0, sm.request_preempt).start()
"""
LIBRARY = """
from smach_oracle import OracleContainer
OracleContainer.wrap(sm, settings={'max_recoveries': 0, 'expert': {'deadline_s': 1.0}}, name='TASK')
"""
SLOW_OBSERVER = """
from smach_oracle.oracle import oracle_of
oracle_of(sm).events.observers.append(lambda event: time.sleep(0.5))
"""
RUN = """
print('OUTCOME {}'.format(sm.execute()), flush=True)
"""
# rospy has closed the topics by then, and rospy.is_shutdown does not say so yet
LATE_TRIAL = (
    RUN
    + """
rospy.core.add_preshutdown_hook(lambda reason: print('LATE {}'.format(sm.execute()), flush=True))
rospy.signal_shutdown('the end')
"""
)
# kind of end: exit code, outcome; the exception surfaces as InvalidUserCodeError
ENDS = {
    'succeeds': (0, 'succeeded'),
    'fails': (0, 'aborted'),
    'raises': (1, ''),
    'preempted': (0, 'preempted'),
    'signalled': (0, 'preempted'),
}
EXIT_LIMIT_S = 30.0  # of a machine that is busy with other things: for good is what is not allowed


class ProcessEndTest(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.bags = folder.name

    def ended(self, task: Process, how: str) -> Tuple[int, List[OracleEvent]]:
        """Exit code of the process, and the events of its one bag."""
        self.assertTrue(task.says('THERE'), task.output())
        if how == 'signalled':
            task.signal(signal.SIGINT)
        code = task.wait(EXIT_LIMIT_S)
        (events,) = recorded_events(self.bags)
        return code, events

    def check(self, how: str, task: Process) -> None:
        code, events = self.ended(task, how)
        expected_code, outcome = ENDS[how]
        self.assertEqual(
            (code, events[-1].kind, events[-1].outcome),
            (expected_code, OracleEvent.TRIAL_END, outcome),
            task.output(),
        )
        if outcome:
            self.assertIn('OUTCOME ' + outcome, task.output())

    def library(self, how: str, more: str = '') -> Process:
        program = Process(
            [
                sys.executable,
                script(self, TASK + LIBRARY + more + RUN),
                how,
                '_record:=' + self.bags,
            ]
        )
        self.addCleanup(program.stop)
        return program

    def check_library(self, how: str) -> None:
        self.check(how, self.library(how))

    def check_oracle_run(self, how: str) -> None:
        settings = script(
            self, json.dumps({'max_recoveries': 0, 'expert': {'deadline_s': 1.0}}), 'oracle.yaml'
        )
        self.check(
            how,
            oracle_run(
                self, '--config', settings, '--record', self.bags, script(self, TASK + RUN), how
            ),
        )

    def test_a_program_that_uses_the_library_and_succeeds(self) -> None:
        self.check_library('succeeds')

    def test_a_program_that_uses_the_library_and_fails(self) -> None:
        self.check_library('fails')

    def test_a_program_that_uses_the_library_and_raises(self) -> None:
        self.check_library('raises')

    def test_a_program_that_uses_the_library_and_is_preempted(self) -> None:
        self.check_library('preempted')

    def test_a_program_that_uses_the_library_and_is_signalled(self) -> None:
        self.check_library('signalled')

    def test_a_script_under_oracle_run_that_succeeds(self) -> None:
        self.check_oracle_run('succeeds')

    def test_a_script_under_oracle_run_that_fails(self) -> None:
        self.check_oracle_run('fails')

    def test_a_script_under_oracle_run_that_raises(self) -> None:
        self.check_oracle_run('raises')

    def test_a_script_under_oracle_run_that_is_preempted(self) -> None:
        self.check_oracle_run('preempted')

    def test_a_script_under_oracle_run_that_is_signalled(self) -> None:
        self.check_oracle_run('signalled')

    def test_the_end_is_in_the_bag_though_an_observer_is_slow(self) -> None:
        self.check('signalled', self.library('signalled', SLOW_OBSERVER))

    def test_a_trial_on_topics_that_rospy_has_closed_is_no_error(self) -> None:
        program = Process([sys.executable, script(self, TASK + LIBRARY + LATE_TRIAL), 'succeeds'])
        self.addCleanup(program.stop)
        self.assertEqual(program.wait(EXIT_LIMIT_S), 0, program.output())
        self.assertIn('LATE succeeded', program.output())
        for word in ('closed topic', 'ERROR', 'Traceback'):
            self.assertNotIn(word, program.output())


if __name__ == '__main__':
    import rostest

    rospy.init_node('oracle_process_end')
    rostest.rosrun('smach_oracle', 'oracle_process_end', ProcessEndTest, sys.argv)
