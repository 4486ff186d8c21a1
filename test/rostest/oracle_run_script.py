#!/usr/bin/env python3
"""An unmodified script under oracle_run, as its author, an operator and a viewer see it."""

import glob
import os
import sys
import tempfile
import unittest
from typing import List

import actionlib
import rosbag
import rosgraph
import rospy
from oracle_support import EventLog, FrontEnd, oracle_run, script
from waiting import wait_for

from smach_msgs.msg import SmachContainerStructure
from smach_oracle.msg import ExpertDecision, MoveArmsAsideAction, OracleEvent, OracleRates
from smach_oracle.srv import AnswerQueryRequest

SCRIPT = """
import sys, rospy, smach, smach_ros
from smach_oracle.msg import MoveArmsAsideAction
rospy.init_node('task')
sm = smach.StateMachine(outcomes=['succeeded', 'aborted', 'preempted'])
with sm:
    smach.StateMachine.add('MOVE', smach_ros.SimpleActionState('move', MoveArmsAsideAction),
                           {'succeeded': 'AGAIN'})
    smach.StateMachine.add('AGAIN', smach_ros.SimpleActionState('move', MoveArmsAsideAction))
for name in sys.argv[1:]:
    print('OUTCOME {}'.format(sm.execute()), flush=True)
    sys.stdin.readline()
"""
TWO_TRIALS = ('one', 'two')
LATE_NODE = """
import threading, rospy, smach
from std_msgs.msg import String

def machine(label, work):
    sm = smach.StateMachine(outcomes=['succeeded'])
    with sm:
        smach.StateMachine.add(label, smach.CBState(work, outcomes=['succeeded']))
    return sm

def boot(userdata):
    return 'succeeded'

def wait(userdata):
    runs.set()
    is_over.wait(60)
    return 'succeeded'

def task(userdata):
    rospy.sleep(1.0)  # in which a recorder finds the topics
    return 'succeeded'

runs, is_over = threading.Event(), threading.Event()
boot, beside, task = machine('BOOT', boot), machine('BESIDE', wait), machine('TASK', task)
boot.execute()
thread = threading.Thread(target=beside.execute)
thread.start()
runs.wait(60)
rospy.init_node('task')
talk = rospy.Publisher('/talk', String, latch=True, queue_size=1)
talk.publish('hello')
task.execute()
is_over.set()
thread.join()
for each in (boot, beside):
    each.execute()
"""


class MoveServer:
    """An action server that ends goals as it is told, in turn; succeeds when it has not been
    told.
    """

    def __init__(self) -> None:
        self.results: List[str] = []
        self._server = actionlib.SimpleActionServer(
            'move', MoveArmsAsideAction, self._execute, auto_start=False
        )
        self._server.start()

    def _execute(self, goal: object) -> None:
        result = self.results.pop(0) if self.results else 'succeed'
        if result == 'take long':
            rospy.sleep(0.5)  # a motion takes its time, in which a recorder finds the topics
        if result == 'abort':
            self._server.set_aborted()
        else:
            self._server.set_succeeded()


class OracleRunTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        cls.server = MoveServer()

    def setUp(self) -> None:
        self.server.results = []

    def run_task(self, *options: str, trials: tuple = TWO_TRIALS[:1]) -> object:
        return oracle_run(self, *options, script(self, SCRIPT), *trials)

    def test_a_failing_action_is_recovered_from_and_every_event_is_published(self) -> None:
        log = EventLog(self, 'task')
        self.server.results = ['succeed', 'succeed', 'abort']
        task = self.run_task(trials=TWO_TRIALS)
        self.assertTrue(task.says('OUTCOME succeeded'), task.output())
        self.assertTrue(wait_for(log.connected))
        task.go_on()
        self.assertTrue(
            wait_for(lambda: task.output().count('OUTCOME succeeded') == 2), task.output()
        )
        task.go_on()
        self.assertEqual(task.wait(), 0, task.output())
        end = log.wait_for(OracleEvent.TRIAL_END)[-1]
        events = [event for event in log.events if event.trial_id == end.trial_id]
        self.assertEqual([event.seq for event in events], list(range(len(events))))
        self.assertEqual(events[0].kind, OracleEvent.TRIAL_START)
        failure = log.of(OracleEvent.FAILURE)[-1]
        self.assertEqual(
            (failure.state, failure.outcome, failure.failure_kind),
            ('MOVE', 'aborted', OracleEvent.FELL_THROUGH),
        )
        self.assertEqual(log.of(OracleEvent.JUMP)[-1].target, 'MOVE')
        self.assertEqual(end.outcome, 'succeeded')

    def test_without_the_oracle_the_same_failure_ends_the_machine(self) -> None:
        self.server.results = ['abort']
        task = self.run_task('--without-oracle')
        self.assertTrue(task.says('OUTCOME aborted'), task.output())
        task.go_on()
        self.assertEqual(task.wait(), 0)

    def test_the_interface_is_where_the_documentation_says(self) -> None:
        task = self.run_task()
        self.assertTrue(task.says('OUTCOME succeeded'), task.output())
        master = rosgraph.Master('/test')
        types = dict(master.getPublishedTopics(''))
        expected = {
            '/task/oracle/events': 'smach_oracle/OracleEvent',
            '/task/oracle/rates': 'smach_oracle/OracleRates',
            '/task/oracle/trials': 'smach_oracle/NodeTrials',
            '/task/expert_query/open': 'smach_oracle/OpenQueries',
            '/task/expert_query/result': 'smach_oracle/ExpertQueryActionResult',
            '/task/smach/container_structure': 'smach_msgs/SmachContainerStructure',
            '/task/smach/container_status': 'smach_msgs/SmachContainerStatus',
        }
        self.assertEqual({name: types.get(name) for name in expected}, expected)
        services = [name for name, _ in master.getSystemState()[2]]
        self.assertIn('/task/expert_query/claim', services)
        self.assertIn('/task/expert_query/answer', services)
        # latched: nothing moves any more
        rates = rospy.wait_for_message('/task/oracle/rates', OracleRates, 10.0)
        self.assertEqual(
            {(row.path, row.state, row.successes) for row in rates.states},
            {('task', 'MOVE', 1), ('task', 'AGAIN', 1)},
        )
        self.assertIn(
            ('MOVE', 'succeeded', 'AGAIN', 1),
            [(edge.state, edge.outcome, edge.target, edge.count) for edge in rates.transitions],
        )
        structure = rospy.wait_for_message(
            '/task/smach/container_structure', SmachContainerStructure, 10.0
        )
        edges = set(zip(structure.outcomes_from, structure.outcomes_to))
        self.assertEqual(structure.path, '/task')
        self.assertIn(('MOVE', 'ORACLE'), edges)
        self.assertIn(('ORACLE', 'AGAIN'), edges)
        task.go_on()
        self.assertEqual(task.wait(), 0)

    def test_an_introspection_server_of_the_scripts_own_is_not_doubled(self) -> None:
        own = (
            SCRIPT.replace(
                'for name in',
                "viewer = smach_ros.IntrospectionServer('mine', sm, '/MINE')\n"
                'viewer.start()\nfor name in',
            )
            + '\nviewer.stop()\n'
        )  # its threads may be no daemons
        task = oracle_run(self, script(self, own), 'one')
        self.assertTrue(task.says('OUTCOME succeeded'), task.output())
        structure = rospy.wait_for_message(
            '/mine/smach/container_structure', SmachContainerStructure, 10.0
        )
        self.assertIn('ORACLE', structure.children)
        published = [topic for topic, _ in rosgraph.Master('/test').getPublishedTopics('')]
        self.assertNotIn('/task/smach/container_structure', published)
        task.go_on()
        self.assertEqual(task.wait(), 0)

    def test_a_check_moves_nothing_and_leaves_no_trace_with_the_master(self) -> None:
        rospy.set_param('/task/oracle', {'max_recoveries': 2})
        self.addCleanup(rospy.delete_param, '/task/oracle')
        before = rosgraph.Master('/test').getSystemState()
        task = self.run_task('--check')
        self.assertTrue(
            wait_for(
                lambda: (
                    not task.running()
                    or self.assertEqual(rosgraph.Master('/test').getSystemState(), before)
                )
            ),
            task.output(),
        )
        self.assertEqual(task.wait(), 0, task.output())
        self.assertIn('max_recoveries 2', task.output())
        self.assertIn('no error in the settings for 1 machine', task.output())

    def test_settings_come_from_the_file_and_over_it_from_the_parameter_server(self) -> None:
        with tempfile.NamedTemporaryFile('w', suffix='.yaml') as config:
            config.write('memory: 4\nexpert: {deadline_s: 0}\nmax_recoveries: 5\n')
            config.flush()
            rospy.set_param('/task/oracle', {'max_recoveries': 0})
            self.addCleanup(rospy.delete_param, '/task/oracle')
            self.server.results = ['abort']
            task = self.run_task('--config', config.name)
            expert = FrontEnd(self, '/task/expert_query')
            question = expert.question()  # max_recoveries 0: the first failure is asked about
        self.assertIsNotNone(question, task.output())
        self.assertEqual(question.query.deadline, 0.0)
        self.assertAlmostEqual(question.query.rate, (3 * 0.1 + 1) / 4)
        self.assertEqual(question.query.robot, '/task')
        reply = expert.answer(
            AnswerQueryRequest(
                question.query.query_id,
                ExpertDecision(kind=ExpertDecision.SUPERSEDE, outcome='succeeded', by='Ann'),
            )
        )
        self.assertTrue(reply.ok, reply.message)
        self.assertTrue(task.says('OUTCOME succeeded'), task.output())
        task.go_on()

    def test_a_wrong_parameter_is_told_by_name(self) -> None:
        rospy.set_param('/task/oracle', {'memory': 'large'})
        self.addCleanup(rospy.delete_param, '/task/oracle')
        task = self.run_task()
        self.assertEqual(task.wait(), 2)
        for part in ('parameter /task/oracle', 'memory', "'large'", 'whole number'):
            self.assertIn(part, task.output())

    def test_each_trial_is_recorded_with_events_rates_and_introspection(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.server.results = ['abort', 'take long', 'take long', 'take long', 'take long']
        task = self.run_task(
            '--record', folder.name, '--record-topic', '/move/goal', trials=TWO_TRIALS
        )
        for _ in TWO_TRIALS:
            task.go_on()
        self.assertEqual(task.wait(), 0, task.output())
        bags = sorted(glob.glob(os.path.join(folder.name, '*.bag')))
        self.assertEqual(len(bags), 2, os.listdir(folder.name))
        for path in bags:
            with rosbag.Bag(path) as bag:
                seen = {
                    topic: [message for _, message, _ in bag.read_messages(topic)]
                    for topic in ('/task/oracle/events', '/task/oracle/rates')
                }
                topics = bag.get_type_and_topic_info()[1]
            events = seen['/task/oracle/events']
            self.assertEqual([event.seq for event in events], list(range(len(events))))
            self.assertEqual(
                (events[0].kind, events[-1].kind), (OracleEvent.TRIAL_START, OracleEvent.TRIAL_END)
            )
            self.assertTrue(seen['/task/oracle/rates'])
            self.assertIn('/move/goal', topics)
            self.assertIn('/task/smach/container_status', topics)

    def test_topics_are_recorded_from_when_the_script_is_a_node(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        task = oracle_run(
            self, '--record', folder.name, '--record-topic', '/talk', script(self, LATE_NODE)
        )
        self.assertEqual(task.wait(), 0, task.output())
        seen = []
        for path in sorted(glob.glob(os.path.join(folder.name, '*.bag'))):
            with rosbag.Bag(path) as bag:
                topics = bag.get_type_and_topic_info()[1]
                (events,) = [topic for topic in topics if topic.endswith('oracle/events')]
                numbers = [event.seq for _, event, _ in bag.read_messages(events)]
                (state,) = {event.state for _, event, _ in bag.read_messages(events) if event.state}
            self.assertEqual(numbers, list(range(len(numbers))))
            seen.append((state, events))
            if events == '/task/oracle/events':
                for topic in (
                    '/talk',
                    '/task/oracle/rates',
                    '/task/record/status',
                    '/task/smach/container_structure',
                ):
                    self.assertIn(topic, topics)
        self.assertEqual(
            seen,
            [
                ('BOOT', '/oracle/events'),
                ('BESIDE', '/oracle/events'),
                ('TASK', '/task/oracle/events'),
                ('BOOT', '/task/oracle/events'),
                ('BESIDE', '/task/oracle/events'),
            ],
        )
        self.assertEqual(len(os.listdir(folder.name)), len(seen), 'none is left open')


if __name__ == '__main__':
    import rostest

    rospy.init_node('oracle_run_script')
    rostest.rosrun('smach_oracle', 'oracle_run_script', OracleRunTest, sys.argv)
