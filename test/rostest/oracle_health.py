#!/usr/bin/env python3
"""A script under oracle_run while its robot is not well, by a topic and by the diagnostics."""

import os
import signal
import sys
import tempfile
import unittest
from typing import Any, List

import actionlib
import genpy.dynamic
import rospy
from oracle_support import EventLog, Process, oracle_run, recorded_events, script
from std_msgs.msg import Bool
from waiting import stays, wait_for

from smach_msgs.msg import SmachContainerStatus
from smach_oracle.analysis.trials import load_trials
from smach_oracle.msg import MoveArmsAsideAction, OracleEvent
from smach_oracle.trial_counter import TrialEnding

SCRIPT = """
import sys, rospy, smach, smach_ros
from smach_oracle.msg import MoveArmsAsideAction
rospy.init_node('task')
sm = smach.StateMachine(outcomes=['succeeded', 'aborted', 'preempted'])
with sm:
    smach.StateMachine.add('DRIVE', smach_ros.SimpleActionState('drive', MoveArmsAsideAction))
print('OUTCOME {}'.format(sm.execute()), flush=True)
"""
# of diagnostic_msgs, which need not be installed: then the task reads it by this definition
DEFINITION = """Header header
DiagnosticStatus[] status
{0}
MSG: std_msgs/Header
uint32 seq
time stamp
string frame_id
{0}
MSG: diagnostic_msgs/DiagnosticStatus
byte OK=0
byte WARN=1
byte ERROR=2
byte STALE=3
byte level
string name
string message
string hardware_id
KeyValue[] values
{0}
MSG: diagnostic_msgs/KeyValue
string key
string value
""".format('=' * 80)
MD5 = '60810da900de1dd6ddd437c3503511da'
TOPIC = '{healthy: {topic: /motors_on, name: motors}, max_recoveries: 0}'
DIAGNOSTICS = '{healthy: [{diagnostics: Power System}], max_recoveries: 0}'


class Motors:
    """Runs the drive: goals are aborted while the motors are off, and that is told a little
    later.
    """

    def __init__(self) -> None:
        self.on = True
        self.goals = 0
        self._topic = rospy.Publisher('/motors_on', Bool, queue_size=10, latch=True)
        classes = genpy.dynamic.generate_dynamic('diagnostic_msgs/DiagnosticArray', DEFINITION)
        self.array = classes['diagnostic_msgs/DiagnosticArray']
        self._status = classes['diagnostic_msgs/DiagnosticStatus']
        self._diagnostics = rospy.Publisher('/diagnostics', self.array, queue_size=10)
        self._server = actionlib.SimpleActionServer(
            'drive', MoveArmsAsideAction, self._execute, auto_start=False
        )
        self._server.start()
        self._timer = rospy.Timer(rospy.Duration(0.1), self._tell)

    def _tell(self, _event: Any) -> None:
        self._topic.publish(Bool(self.on))
        status = self._status(level=0 if self.on else 2, name='/Power System', message='breaker')
        self._diagnostics.publish(self.array(status=[status]))

    def _execute(self, goal: object) -> None:
        self.goals += 1
        if self.goals == 1:  # somebody presses the run-stop
            self.on = False
            self._server.set_aborted()
        else:
            self._server.set_succeeded()


class OracleHealthTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        cls.motors = Motors()

    def setUp(self) -> None:
        self.motors.on, self.motors.goals = True, 0
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name

    def run_task(self, settings: str) -> Process:
        """Start the script, and wait until it waits to be well."""
        config = os.path.join(self.folder, 'oracle.yaml')
        with open(config, 'w') as file:
            file.write(settings)
        self.log = EventLog(self, 'task')
        self.active: List[List[str]] = []
        subscriber = rospy.Subscriber(
            '/task/smach/container_status',
            SmachContainerStatus,
            lambda message: self.active.append(message.active_states),
        )
        self.addCleanup(subscriber.unregister)
        task = oracle_run(self, '--config', config, '--record', self.folder, script(self, SCRIPT))
        self.assertTrue(
            wait_for(lambda: 'while the robot is not well' in task.output()), task.output()
        )
        return task

    def check_it_waits_and_goes_on(self, settings: str, why: str) -> None:
        task = self.run_task(settings)
        self.assertTrue(wait_for(lambda: ['ORACLE'] in self.active))
        self.assertTrue(stays(lambda: self.motors.goals == 1, 1.0))
        self.assertTrue(task.running())
        self.motors.on = True
        self.assertEqual(task.wait(), 0, task.output())
        self.assertIn('OUTCOME succeeded', task.output())
        self.assertIn(
            'task/DRIVE failed while the robot is not well ({}): waiting; no failure is '
            'counted'.format(why),
            task.output(),
        )
        self.assertEqual(self.motors.goals, 2)
        (events,) = recorded_events(self.folder)
        self.assertEqual([event.seq for event in events], list(range(len(events))))
        start, end = [
            event
            for event in events
            if event.kind in (OracleEvent.HEALTH_WAIT_START, OracleEvent.HEALTH_WAIT_END)
        ]
        self.assertEqual((start.path, start.state, start.text), ('task', 'DRIVE', why))
        self.assertEqual((end.outcome, '"states": ["task/DRIVE"]' in end.data), ('well', True))
        (trial,) = load_trials([self.folder]).trials
        self.assertEqual(
            (trial.failures, trial.recoveries, trial.questions, trial.ending),
            (0, 0, 0, TrialEnding.SUCCESS),
        )
        self.assertAlmostEqual(trial.unwell_s, end.wall_time - start.wall_time, 3)
        self.assertGreater(trial.unwell_s, 1.0)

    def test_by_a_topic(self) -> None:
        self.check_it_waits_and_goes_on(TOPIC, 'motors: off')

    def test_by_the_diagnostics(self) -> None:
        self.assertEqual(self.motors.array._md5sum, MD5)  # the one that robots publish
        self.check_it_waits_and_goes_on(DIAGNOSTICS, 'Power System: error (breaker)')

    def test_a_signal_ends_the_wait(self) -> None:
        task = self.run_task(TOPIC)
        task.signal(signal.SIGINT)
        task.wait()
        self.assertIn('OUTCOME preempted', task.output())
        (events,) = recorded_events(self.folder)
        kinds = [event.kind for event in events]
        self.assertIn(OracleEvent.HEALTH_WAIT_START, kinds)
        self.assertEqual(kinds[-1], OracleEvent.TRIAL_END)
        (end,) = [event for event in events if event.kind == OracleEvent.HEALTH_WAIT_END]
        self.assertEqual(end.outcome, 'stopped')
        self.assertNotIn(OracleEvent.FAILURE, kinds)
        self.assertEqual(self.motors.goals, 1)

    def test_a_topic_that_nobody_publishes_is_named_in_a_warning(self) -> None:
        config = os.path.join(self.folder, 'oracle.yaml')
        with open(config, 'w') as file:
            file.write('healthy: {topic: /motors_no}\n')
        task = oracle_run(self, '--config', config, script(self, SCRIPT))
        self.assertEqual(task.wait(), 0, task.output())
        self.assertIn('OUTCOME succeeded', task.output())
        self.assertEqual(
            task.output().count('topic /motors_no has not published yet, so its condition holds'), 1
        )


if __name__ == '__main__':
    import rostest

    rospy.init_node('oracle_health')
    rostest.rosrun('smach_oracle', 'oracle_health', OracleHealthTest, sys.argv)
