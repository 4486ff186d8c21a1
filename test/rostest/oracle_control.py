#!/usr/bin/env python3
"""Operators hold a script under oracle_run: by services, typed commands, and a viewer."""

import os
import signal
import sys
import tempfile
import unittest
from typing import Any, List, Optional

import rospy
from oracle_support import EventLog, Process, oracle_run, recorded_events, script
from waiting import wait_for

from smach_msgs.msg import SmachContainerInitialStatusCmd
from smach_oracle.expert.terminal.operator_commands import OperatorCommands
from smach_oracle.msg import ControlStatus, MachineControl, OracleEvent
from smach_oracle.srv import CommandMachine, SendMachine, SetAutonomy, SetBreakpoint

SCRIPT = """
import sys, rospy, smach, smach_ros
rospy.init_node('task')
class Work(smach.State):
    def __init__(self, label, waits=False):
        smach.State.__init__(self, outcomes=['succeeded'])
        self.label, self.waits = label, waits
    def execute(self, ud):
        print('RUNS {}'.format(self.label), flush=True)
        if self.waits:
            sys.stdin.readline()
        return 'succeeded'
inner = smach.StateMachine(outcomes=['succeeded', 'preempted'])
with inner:
    smach.StateMachine.add('X', Work('X'), {'succeeded': 'Y'})
    smach.StateMachine.add('Y', Work('Y'))
sm = smach.StateMachine(outcomes=['succeeded', 'aborted', 'preempted'])
with sm:
    smach.StateMachine.add('FIRST', Work('FIRST', True), {'succeeded': 'INNER'})
    smach.StateMachine.add('INNER', inner, {'succeeded': 'LAST'})
    smach.StateMachine.add('LAST', Work('LAST'))
"""
EXECUTE = """
print('OUTCOME {}'.format(sm.execute()), flush=True)
"""
NESTED_BY_ITSELF = """
import time
sm.execute()
x = inner.get_children()['X']
def until_preempted(ud):
    print('ALONE', flush=True)
    while not x.preempt_requested():
        time.sleep(0.01)
    print('OBEYS', flush=True)
    x.service_preempt()
    return 'succeeded'
x.execute = until_preempted
inner.execute()
"""
OWN_SERVER = """
sis = smach_ros.IntrospectionServer('viewed', sm, '/SHOWN')
sis.start()
print('OUTCOME {}'.format(sm.execute()), flush=True)
sis.stop()
"""
GUARDED = '{states: {FIRST: {on_retry: confirm}}}'
CONFIRMED = '{states: {INNER/Y: {autonomy: confirm}, LAST: {autonomy: announce}}}'


class OracleControlTest(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name
        self.status: Optional[MachineControl] = None

    def run_task(self, text: str = SCRIPT + EXECUTE, settings: str = '{}') -> Process:
        """Start the script, and wait until its first state runs and it can be commanded."""
        config = os.path.join(self.folder, 'oracle.yaml')
        with open(config, 'w') as file:
            file.write(settings)
        self.log = EventLog(self, 'task')
        subscriber = rospy.Subscriber('/task/oracle/control', ControlStatus, self.take)
        self.addCleanup(subscriber.unregister)
        task = oracle_run(self, '--config', config, '--record', self.folder, script(self, text))
        self.assertTrue(task.says('RUNS FIRST'), task.output())
        rospy.wait_for_service('/task/oracle/pause', 20.0)
        self.assertTrue(
            wait_for(
                lambda: self.status is not None and self.status.running and self.log.connected()
            )
        )
        return task

    def take(self, message: ControlStatus) -> None:
        for machine in message.machines:
            self.status = machine

    def call(self, name: str, kind: Any = CommandMachine, **request: Any) -> str:
        """Call a service of the node's; what it says."""
        response = rospy.ServiceProxy('/task/oracle/' + name, kind)(**request)
        self.assertTrue(response.ok, response.message)
        return str(response.message)

    def held(self) -> List[str]:
        return [
            '{}/{}'.format(each.path, each.state) for each in self.status.active if each.held_by
        ]

    def assert_waits_before(self, place: str) -> None:
        self.assertTrue(wait_for(lambda: self.held() == [place]), str(self.status))

    def assert_ends(self, task: Process, outcome: str) -> List[OracleEvent]:
        """Wait for the end; the events of the bag."""
        self.assertEqual(task.wait(), 0 if outcome == 'succeeded' else task.wait(), task.output())
        self.assertIn('OUTCOME ' + outcome, task.output())
        (events,) = recorded_events(self.folder)
        self.assertEqual([event.seq for event in events], list(range(len(events))))
        return events

    def test_a_nested_machine_that_is_executed_by_itself_obeys(self) -> None:
        def preempt(task: Process) -> None:
            self.assertEqual(self.call('preempt'), 'task/INNER is asked to stop')

        for stop in (preempt, lambda task: task.signal(signal.SIGINT)):
            task = self.run_task(SCRIPT + NESTED_BY_ITSELF)
            task.go_on()
            self.assertTrue(task.says('ALONE'), task.output())
            self.assertTrue(wait_for(lambda: self.status.running), 'its trial is shown')
            stop(task)
            self.assertEqual(task.wait(), 0, task.output())
            self.assertIn('OBEYS', task.output())

    def test_of_two_alike_the_one_that_runs_obeys(self) -> None:
        built = SCRIPT[SCRIPT.index('inner =') :]
        in_turn = """
for each in first, sm, first:
    print('OUTCOME', each.execute(), flush=True)
"""
        task = self.run_task(SCRIPT + 'first = sm\n' + built + in_turn)
        task.go_on()
        self.assertTrue(wait_for(lambda: task.output().count('RUNS FIRST') == 2), task.output())
        task.go_on()
        self.assertTrue(wait_for(lambda: task.output().count('RUNS FIRST') == 3), task.output())
        self.assertEqual(self.call('preempt'), 'task is asked to stop')
        self.assertEqual(self.call('pause'), 'task is paused; runs to its end: FIRST in task')
        self.call('resume')
        task.go_on()
        self.assertEqual(task.wait(), 0, task.output())

    def test_a_machine_that_is_built_anew_is_held_as_the_one_before(self) -> None:
        built = SCRIPT[SCRIPT.index('inner =') :]
        task = self.run_task(SCRIPT + EXECUTE + built + EXECUTE)
        self.call('breakpoint', SetBreakpoint, pattern='FIRST')
        task.go_on()
        self.assertTrue(task.says('OUTCOME succeeded'), task.output())
        self.assert_waits_before('task/FIRST')
        self.assertEqual(task.output().count('RUNS FIRST'), 1, task.output())
        self.call('resume')
        task.go_on()
        self.assertEqual(task.wait(), 0, task.output())
        self.assertEqual(task.output().count('RUNS FIRST'), 2, task.output())

    def test_pause_step_and_resume(self) -> None:
        task = self.run_task()
        self.assertEqual(self.call('pause'), 'task is paused; runs to its end: FIRST in task')
        task.go_on()
        self.assert_waits_before('task/INNER')
        self.assertTrue(self.status.paused)
        self.assertEqual(self.call('step', by='eva'), 'runs now: INNER in task')
        self.assert_waits_before('task/INNER/X')
        self.assertNotIn('RUNS X', task.output())
        self.assertEqual(self.call('resume', path='task'), 'runs now: X in task/INNER')
        events = self.assert_ends(task, 'succeeded')
        me = rospy.get_name()
        self.assertEqual(
            [
                (event.outcome, event.by)
                for event in events
                if event.kind == OracleEvent.OPERATOR_COMMAND
            ],
            [('pause', me), ('step', 'eva'), ('resume', me)],
        )
        self.assertEqual(
            [
                (event.path, event.state, event.outcome)
                for event in events
                if event.kind == OracleEvent.HOLD_END
            ],
            [('task', 'INNER', 'stepped'), ('task/INNER', 'X', 'resumed')],
        )

    def test_what_waits_for_a_confirmation_shows_so(self) -> None:
        task = self.run_task(settings=CONFIRMED)
        task.go_on()
        self.assert_waits_before('task/INNER/Y')
        (waiting,) = [each for each in self.status.active if each.held_by]
        self.assertEqual((waiting.held_by, waiting.waits_for_confirmation), ('confirm', True))
        self.assertFalse(self.status.paused)
        self.assertEqual(self.call('confirm', path='task/INNER'), 'runs now: Y in task/INNER')
        events = self.assert_ends(task, 'succeeded')
        (announced,) = [event for event in events if event.kind == OracleEvent.ANNOUNCE]
        self.assertEqual(announced.state, 'LAST')

    def test_a_preempt_or_a_signal_ends_a_pause_at_once(self) -> None:
        for end in (lambda task: self.call('preempt'), lambda task: task.signal(signal.SIGINT)):
            with self.subTest(), tempfile.TemporaryDirectory() as self.folder:
                task = self.run_task()
                self.call('breakpoint', SetBreakpoint, pattern='INNER/X')
                task.go_on()
                self.assert_waits_before('task/INNER/X')
                self.assertEqual(self.status.paused_by, 'breakpoint INNER/X')
                end(task)
                events = self.assert_ends(task, 'preempted')
                self.assertNotIn('RUNS X', task.output())
                self.assertEqual(
                    [event.outcome for event in events if event.kind == OracleEvent.HOLD_END],
                    ['preempted'],
                )

    def test_going_elsewhere_is_checked(self) -> None:
        task = self.run_task(settings=GUARDED)
        self.call('autonomy', SetAutonomy, pattern='INNER', level='confirm')
        go_to = rospy.ServiceProxy('/task/oracle/go_to', SendMachine)
        self.assertIn("has no state 'NOWHERE' to go to", go_to(state='NOWHERE').message)
        task.go_on()
        self.assert_waits_before('task/INNER')
        refused = go_to(path='task', state='FIRST')
        self.assertEqual(
            (refused.ok, refused.message),
            (False, 'going to FIRST may repeat FIRST: confirm that it may'),
        )
        self.assertTrue(go_to('task', 'FIRST', True, '').ok)
        self.assertTrue(wait_for(lambda: task.output().count('RUNS FIRST') == 2))
        self.assertTrue(go_to('', 'LAST', False, '').ok)
        task.go_on()
        events = self.assert_ends(task, 'succeeded')
        self.assertEqual(
            [event.target for event in events if event.kind == OracleEvent.SENT], ['FIRST', 'LAST']
        )
        self.assertNotIn('RUNS X', task.output())

    def check_a_viewer(self, task: Process, server: str, path: str) -> None:
        topic = rospy.Publisher(
            server + '/smach/container_init', SmachContainerInitialStatusCmd, queue_size=10
        )
        self.addCleanup(topic.unregister)
        self.assertTrue(wait_for(topic.get_num_connections))
        nothing = 'gAN9cQAu'  # no userdata
        command = SmachContainerInitialStatusCmd(path, ['FIRST'], nothing)
        self.assertTrue(
            wait_for(
                lambda: (
                    topic.publish(command)
                    or 'may repeat FIRST'
                    in ''.join(event.text for event in self.log.of(OracleEvent.WARNING))
                )
            ),
            task.output(),
        )
        command.initial_states = ['LAST']
        self.assertTrue(
            wait_for(lambda: topic.publish(command) or self.status.jump_states == ['LAST'])
        )
        task.go_on()
        events = self.assert_ends(task, 'succeeded')
        self.assertEqual(
            [
                (event.state, event.target, event.by)
                for event in events
                if event.kind == OracleEvent.SENT
            ],
            [('INNER', 'LAST', rospy.get_name())],
        )

    def test_a_viewer_sends_a_machine_that_runs(self) -> None:
        self.check_a_viewer(self.run_task(settings=GUARDED), '/task', '/task')

    def test_a_viewer_of_the_script_s_own_server_does_so_too(self) -> None:
        self.check_a_viewer(self.run_task(SCRIPT + OWN_SERVER, GUARDED), '/viewed', '/SHOWN')

    def test_typed_commands_find_the_robot(self) -> None:
        task = self.run_task()
        operator = OperatorCommands('ann')
        self.assertEqual(
            operator.carry_out('pause'),
            [('  /task: task is paused; runs to its end: FIRST in task', 'green')],
        )
        task.go_on()
        self.assert_waits_before('task/INNER')
        self.assertTrue(
            wait_for(
                lambda: (
                    operator.carry_out('status')
                    == [
                        ('  /task task: paused by ann', 'bold'),
                        ('    task/INNER waits (paused)', 'yellow'),
                    ]
                )
            )
        )
        operator.carry_out('goto task LAST')
        operator.carry_out('resume')
        self.assert_ends(task, 'succeeded')
        self.assertNotIn('RUNS X', task.output())


if __name__ == '__main__':
    import rostest

    rospy.init_node('oracle_control')
    rostest.rosrun('smach_oracle', 'oracle_control', OracleControlTest, sys.argv)
