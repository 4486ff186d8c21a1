#!/usr/bin/env python3
"""Machines on the bench in a node: what a robot's tools see of them, and that it goes away."""

import sys
import tempfile
import unittest

import rosgraph
import rospy
from oracle_support import oracle_run, script
from std_srvs.srv import Trigger, TriggerResponse
from waiting import wait_for

import smach
import smach_ros
from smach_msgs.msg import SmachContainerStructure
from smach_oracle.msg import OracleEvent, OracleRates
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.testing import Bench, expert, fail, goto, overrun, soak
from smach_oracle.testing.recorded import recorded_trials

OUTCOMES = ['succeeded', 'aborted', 'preempted']

FAILS_ONCE = """
import rospy, smach

class Works(smach.State):
    runs = 0

    def __init__(self):
        smach.State.__init__(self, outcomes=['succeeded', 'aborted'])

    def execute(self, userdata):
        Works.runs += 1
        return 'aborted' if Works.runs == 1 else 'succeeded'

rospy.init_node('task')
machine = smach.StateMachine(outcomes=['succeeded', 'aborted'])
with machine:
    smach.StateMachine.add('PICK', Works(), {'succeeded': 'PLACE'})
    smach.StateMachine.add('PLACE', Works())
for trial in range(2):
    print(machine.execute())
"""


def build_machine() -> smach.StateMachine:
    """CALL, a service, and DONE."""
    machine = smach.StateMachine(OUTCOMES)
    with machine:
        smach.StateMachine.add(
            'CALL', smach_ros.ServiceState('/lamp', Trigger), {'succeeded': 'DONE'}
        )
        smach.StateMachine.add(
            'DONE', smach.CBState(lambda userdata: 'succeeded', outcomes=OUTCOMES)
        )
    return machine


class BenchTest(unittest.TestCase):
    def setUp(self) -> None:
        self.calls = 0
        server = rospy.Service('/lamp', Trigger, self.serve)
        self.addCleanup(server.shutdown)

    def serve(self, request: object) -> TriggerResponse:
        self.calls += 1
        return TriggerResponse(True, '')

    def test_a_state_of_smach_ros_fails_without_doing_its_work(self) -> None:
        with Bench(build_machine(), [fail('CALL', visit=(1, 2))]) as bench:
            bench.run().assert_recovered('CALL').assert_failed('CALL', times=2)
        self.assertEqual(self.calls, 1)

    def test_events_and_structure_are_published_and_then_gone(self) -> None:
        events = []
        subscriber = rospy.Subscriber('~oracle/events', OracleEvent, events.append)
        self.addCleanup(subscriber.unregister)
        machine = build_machine()
        for _ in range(2):
            del events[:]
            with Bench(machine, [fail('CALL', visit=1)], ros=True) as bench:
                bench.run()  # makes the topic
                self.assertTrue(wait_for(subscriber.get_num_connections))
                trial = bench.run().assert_recovered('CALL')
                structure = rospy.wait_for_message(
                    '~smach/container_structure', SmachContainerStructure, 20.0
                )
                self.assertIn('ORACLE', structure.children)
                end = [event for event in trial.events if event.kind is EventKind.TRIAL_END][0]
                self.assertTrue(
                    wait_for(
                        lambda: (
                            (end.trial_id, end.seq)  # noqa: B023
                            in [(event.trial_id, event.seq) for event in events]
                        )
                    )
                )
            self.assertIs(type(machine), smach.StateMachine)
            self.assertTrue(
                wait_for(
                    lambda: rospy.resolve_name('~smach/container_structure') not in self.topics()
                )
            )
        rates = rospy.wait_for_message('~oracle/rates', OracleRates, 20.0)
        self.assertEqual({row.state for row in rates.states}, {'CALL', 'DONE'})

    def topics(self) -> set:
        return {name for name, _ in rosgraph.Master('/test').getPublishedTopics('')}

    def test_an_expert_by_script_answers_in_the_process(self) -> None:
        with Bench(
            build_machine(),
            [fail('CALL')],
            ros=True,
            expert=expert(goto('DONE')),
            settings={'max_recoveries': 0},
        ) as bench:
            for _ in range(2):
                bench.run().assert_asked_about('CALL', times=1).assert_recovered('CALL')

    def test_a_service_that_takes_too_long_overruns(self) -> None:
        with Bench(
            build_machine(),
            [overrun('CALL', 600, visit=1)],
            settings={'states': {'CALL': {'time_limit_s': 2.0}}},
        ) as bench:
            bench.run().assert_recovered('CALL')

    def test_the_trials_of_a_script_under_oracle_run_are_read_from_their_bags(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            task = oracle_run(self, '--record', folder, script(self, FAILS_ONCE))
            self.assertEqual(task.wait(60), 0, task.output())
            first, second = recorded_trials(folder)
        first.assert_recovered('PICK').assert_failed('PICK', times=1).assert_not_asked()
        second.assert_no_failures().assert_visited(['PICK', 'PLACE'], exactly=True)
        with self.assertRaisesRegex(AssertionError, 'PICK failed .*: trying it again'):
            first.assert_no_failures()

    def test_what_ended_a_recorded_trial_is_known(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            task = oracle_run(
                self,
                '--without-oracle',
                '--record',
                folder,
                script(self, FAILS_ONCE.replace("'aborted' if", '1 / 0 if')),
            )
            self.assertNotEqual(task.wait(60), 0)
            (trial,) = recorded_trials(folder)
        self.assertIn('ZeroDivisionError', str(trial.assert_raised(RuntimeError)))

    def test_a_soak_runs_in_a_node(self) -> None:
        soak(build_machine(), trials=20).assert_all_recovered()
        self.assertGreater(self.calls, 10)


if __name__ == '__main__':
    import rostest

    rospy.init_node('testing_bench')
    rostest.rosrun('smach_oracle', 'testing_bench', BenchTest, sys.argv)
