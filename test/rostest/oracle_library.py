#!/usr/bin/env python3
"""Programs that use OracleContainer themselves, configured by the parameters of their node."""

import sys
import tempfile
import unittest
from typing import Any, List

import actionlib
import rosgraph
import rospy
from actionlib_msgs.msg import GoalStatus
from oracle_support import EventLog, FrontEnd, Process, oracle_run, recorded_events, script
from waiting import wait_for

from smach_msgs.msg import SmachContainerStructure
from smach_oracle.msg import (
    ControlStatus,
    ExpertDecision,
    MoveArmsAsideAction,
    MoveArmsAsideGoal,
    OracleEvent,
    OracleRates,
)
from smach_oracle.srv import AnswerQueryRequest, CommandMachine

PRELUDE = """
import sys, rospy, smach, smach_ros
from smach_oracle import OracleContainer
from smach_oracle.oracle import Settings
class Turn(smach.State):
    def __init__(self, *outcomes):
        smach.State.__init__(self, outcomes=['succeeded', 'aborted'])
        self.left = list(outcomes)
    def execute(self, userdata):
        return self.left.pop(0) if self.left else 'succeeded'
OUTCOMES = ['succeeded', 'aborted', 'preempted']
def run(sm):
    print('OUTCOME {}'.format(sm.execute()), flush=True)
    sys.stdin.readline()
"""
WRAPPED_BEFORE_THE_NODE = (
    PRELUDE
    + """
sm = smach.StateMachine(outcomes=OUTCOMES)
with sm:
    smach.StateMachine.add('PICK', Turn('aborted'))
settings = {'max_recoveries': 3, 'expert': {'deadline_s': 30.0}}
assert OracleContainer.wrap(sm, settings=settings, name='ROBOT') is sm
rospy.init_node('task')
run(sm)
"""
)
WRAPPED_AGAIN = (
    PRELUDE
    + """
rospy.init_node('task')
sm = smach.StateMachine(outcomes=OUTCOMES)
with sm:
    smach.StateMachine.add('PICK', Turn())
for memory in 7, 5:
    OracleContainer.wrap(sm, settings={'memory': memory, 'max_recoveries': 3}).execute()
    told = sm.settings.defaults
    print('SET {} {}'.format(told.memory, told.max_recoveries), flush=True)
"""
)
BUILT_BY_HAND = (
    PRELUDE
    + """
rospy.init_node('task')
view = []
sm = OracleContainer(OUTCOMES, name='HAND_MADE')
with sm:
    OracleContainer.add('PICK', Turn('aborted'), prior=0.2,
                        preconditions=[lambda userdata: not view.append('looked')])
run(sm)
print('LOOKED {}'.format(len(view)), flush=True)
"""
)
FIXED_SETTINGS = (
    PRELUDE
    + """
rospy.init_node('task')
sm = OracleContainer(OUTCOMES, settings=Settings.from_dict({'max_recoveries': 3}))
with sm:
    OracleContainer.add('PICK', Turn('aborted'))
run(sm)
"""
)
OWN_LOGGERS = """
import sys, rospy, smach
from smach_oracle import OracleContainer
rospy.init_node('task')
heard = []
smach.set_loggers(*[lambda text, *args: heard.append(text)] * 4)
sm = smach.StateMachine(outcomes=['succeeded'])
with sm:
    smach.StateMachine.add('PICK', smach.CBState(lambda userdata: 'succeeded',
                                                 outcomes=['succeeded']))
OracleContainer.wrap(sm).execute()
print('HEARD {}'.format(any('terminating' in text for text in heard)), flush=True)
"""
A_NEW_MACHINE_EACH_TRIAL = (
    PRELUDE
    + """
rospy.init_node('task')
for trial in range(30):
    sm = smach.StateMachine(outcomes=OUTCOMES)
    with sm:
        smach.StateMachine.add('PICK', Turn('aborted'))
    OracleContainer.wrap(sm, name='ROBOT').execute()
import gc, threading
gc.collect()
machines = [each for each in gc.get_objects() if isinstance(each, OracleContainer)]
print('LEFT', len(machines), threading.active_count(), flush=True)
"""
)
TRIES_AGAIN = (
    PRELUDE
    + """
rospy.init_node('task')
sm = smach.StateMachine(outcomes=OUTCOMES)
with sm:
    smach.StateMachine.add('PICK', Turn('aborted'))
OracleContainer.wrap(sm)
for attempt in range(3):
    try:
        sm.execute()
    except (ValueError, OSError) as err:
        print('ATTEMPT', attempt, err, flush=True)
"""
)
TWO_MACHINES = (
    PRELUDE
    + """
rospy.init_node('task')
machines = []
for labels in ['PICK'], ['PLACE'], ['PICK']:
    sm = smach.StateMachine(outcomes=OUTCOMES)
    with sm:
        for label in labels:
            smach.StateMachine.add(label, Turn('aborted'))
    machines.append(OracleContainer.wrap(sm))
viewer = smach_ros.IntrospectionServer('mine', machines[1], '/SM_PLACE')
viewer.start()
for sm in machines:
    sm.execute()
print('PATHS {}'.format([sm.path for sm in machines]), flush=True)
sys.stdin.readline()
viewer.stop()
"""
)
EQUAL_MACHINES = (
    PRELUDE
    + """
import dataclasses
from geometry_msgs.msg import PoseStamped
class Hostile:
    armed = False  # SMACH compares machines while they are built
    def __eq__(self, other):
        if Hostile.armed:
            raise RuntimeError('compared')
        return self is other
    def __ne__(self, other):
        return not self == other
    def __hash__(self):
        raise RuntimeError('hashed')
    def __bool__(self):
        raise RuntimeError('asked for its truth')
class Goal(Hostile, PoseStamped): pass
class State(Hostile, Turn): pass
@dataclasses.dataclass
class Task(smach.StateMachine):
    robot: str
    def __post_init__(self):
        smach.StateMachine.__init__(self, OUTCOMES)
class HostileTask(Hostile, smach.StateMachine): pass
machines = [Task('r1'), Task('r1'), HostileTask(OUTCOMES), HostileTask(OUTCOMES)]
rospy.init_node('task')
for number, sm in enumerate(machines):
    sm.userdata.goal = Goal()
    with sm:
        smach.StateMachine.add('PICK_%d' % number, State('aborted'))
Hostile.armed = True
if 'bare' not in sys.argv:
    for number, sm in enumerate(machines):
        OracleContainer.wrap(sm, settings={'max_recoveries': 0 if number % 2 else 3})
for sm in machines:
    print('OUTCOME {}'.format(sm.execute()), flush=True)
sys.stdin.readline()
if 'bare' not in sys.argv:
    from smach_oracle.oracle import unwrap
    for sm in machines:
        assert type(unwrap(sm)) in (Task, HostileTask)
    print('UNWRAPPED', flush=True)
"""
)
ACTION_SERVER = (
    PRELUDE
    + """
from smach_oracle.msg import MoveArmsAsideAction
rospy.init_node('task')
sm = smach.StateMachine(outcomes=OUTCOMES)
with sm:
    smach.StateMachine.add('PICK', Turn('aborted'))
wrapper = smach_ros.ActionServerWrapper('task_server', MoveArmsAsideAction, wrapped_container=sm,
                                        succeeded_outcomes=['succeeded'],
                                        aborted_outcomes=['aborted'],
                                        preempted_outcomes=['preempted'])
wrapper.run_server()
rospy.spin()
"""
)


class LibraryTest(unittest.TestCase):
    def start(self, text: str) -> Process:
        program = Process([sys.executable, script(self, text)])
        self.addCleanup(program.stop)
        return program

    def set_param(self, name: str, value: Any) -> None:
        rospy.set_param('/task/' + name, value)
        self.addCleanup(rospy.delete_param, '/task/' + name)

    def finish(self, program: Process, outcome: str = 'succeeded') -> None:
        self.assertTrue(program.says('OUTCOME ' + outcome), program.output())
        program.go_on()
        self.assertEqual(program.wait(), 0, program.output())

    def answer(self, expert: FrontEnd, question: Any) -> None:
        reply = expert.answer(
            AnswerQueryRequest(
                question.query.query_id,
                ExpertDecision(kind=ExpertDecision.SUPERSEDE, outcome='succeeded', by='Ann'),
            )
        )
        self.assertTrue(reply.ok, reply.message)

    def test_machines_without_a_name_have_their_nodes_and_viewers_keep_theirs(self) -> None:
        program = self.start(TWO_MACHINES)
        self.assertTrue(program.says("PATHS ['task', 'task_2', 'task']"), program.output())
        theirs = rospy.wait_for_message(
            '/mine/smach/container_structure', SmachContainerStructure, 20.0
        )
        self.assertEqual(theirs.path, '/SM_PLACE')
        ours = rospy.wait_for_message(
            '/task/smach/container_structure', SmachContainerStructure, 20.0
        )
        self.assertEqual(ours.path, '/task')
        program.go_on()
        self.assertEqual(program.wait(), 0, program.output())

    def published(self, topic: str) -> bool:
        return topic in dict(rosgraph.Master('/test').getPublishedTopics(''))

    def test_a_machine_wrapped_before_there_was_a_node_is_attached_to_it(self) -> None:
        program = self.start(WRAPPED_BEFORE_THE_NODE)
        self.assertTrue(program.says('OUTCOME succeeded'), program.output())
        rates = rospy.wait_for_message('/task/oracle/rates', OracleRates, 10.0)
        self.assertEqual(
            [(row.path, row.state, row.failures) for row in rates.states], [('ROBOT', 'PICK', 1)]
        )
        self.assertTrue(self.published('/task/smach/container_status'))
        self.finish(program)

    def test_the_parameter_goes_over_the_settings_given_in_code(self) -> None:
        self.set_param('oracle', {'max_recoveries': 0})
        program = self.start(WRAPPED_BEFORE_THE_NODE)
        expert = FrontEnd(self, '/task/expert_query')
        question = expert.question()
        self.assertIsNotNone(question, program.output())
        self.assertAlmostEqual(question.query.deadline, 30.0, delta=5.0)  # as in the code
        self.answer(expert, question)
        self.finish(program)
        self.assertEqual(
            program.output().count(
                'ROBOT: the parameter /task/oracle overrides max_recoveries: 3, now 0'
            ),
            1,
        )

    def test_the_parameter_goes_over_the_settings_of_a_machine_that_is_wrapped_again(self) -> None:
        self.set_param('oracle', {'max_recoveries': 0})
        program = self.start(WRAPPED_AGAIN)
        self.assertEqual(program.wait(), 0, program.output())
        self.assertIn('SET 7 0', program.output())
        self.assertIn('SET 5 0', program.output())

    def test_a_settings_object_is_taken_as_it_is(self) -> None:
        self.set_param('oracle', {'max_recoveries': 0})
        self.finish(self.start(FIXED_SETTINGS))

    def test_a_machine_built_by_hand_runs_its_preconditions(self) -> None:
        program = self.start(BUILT_BY_HAND)
        self.finish(program)
        self.assertIn('LOOKED 1', program.output())

    def test_many_robots_may_share_one_server(self) -> None:
        server = Process(
            [
                sys.executable,
                '-c',
                'import rospy; from smach_oracle.ros.expert.server import '
                'ExpertQueryServer; rospy.init_node("desk"); '
                'ExpertQueryServer("/desk"); rospy.spin()',
            ]
        )
        self.addCleanup(server.stop)
        self.set_param('expert_query_server', '/desk')
        self.set_param('oracle', {'max_recoveries': 0})
        program = self.start(WRAPPED_BEFORE_THE_NODE)
        expert = FrontEnd(self, '/desk')
        question = expert.question()
        self.assertIsNotNone(question, program.output())
        self.assertEqual(question.query.robot, '/task')
        self.assertFalse(self.published('/task/expert_query/open'))
        self.answer(expert, question)
        self.finish(program)

    def test_introspection_can_be_switched_off(self) -> None:
        self.set_param('introspection', False)
        program = self.start(WRAPPED_BEFORE_THE_NODE)
        self.assertTrue(program.says('OUTCOME'), program.output())
        self.assertTrue(self.published('/task/oracle/rates'))
        self.assertFalse(self.published('/task/smach/container_status'))
        self.finish(program)

    def test_a_program_that_has_set_smachs_loggers_keeps_them(self) -> None:
        program = self.start(OWN_LOGGERS)
        self.assertTrue(program.says('HEARD True'), program.output())

    def test_a_parameter_of_the_wrong_kind_is_told_by_name(self) -> None:
        self.set_param('introspection', 'sometimes')
        program = self.start(WRAPPED_BEFORE_THE_NODE)
        self.assertEqual(program.wait(), 1)
        for part in ('parameter /task/introspection', 'sometimes', 'true or false'):
            self.assertIn(part, program.output())

    def test_a_program_that_tries_again_is_told_again(self) -> None:
        for name, value in (('oracle', {'memory': 'long'}), ('record', '/proc/nowhere')):
            with self.subTest(name):
                rospy.set_param('/task/' + name, value)
                program = self.start(TRIES_AGAIN)
                self.assertEqual(program.wait(), 0, program.output())
                rospy.delete_param('/task/' + name)
                self.assertEqual(program.output().count('ATTEMPT'), 3, program.output())
                self.assertEqual(
                    program.output().count('memory: ' if name == 'oracle' else '/proc/nowhere'), 3
                )

    def test_machines_that_are_gone_leave_nothing_behind(self) -> None:
        program = self.start(A_NEW_MACHINE_EACH_TRIAL)
        self.assertTrue(program.says('LEFT', 40.0), program.output())
        machines, threads = [int(word) for word in program.output().split('LEFT ')[1].split()[:2]]
        self.assertLessEqual(machines, 3)
        self.assertLess(threads, 40)

    def folder(self) -> str:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        return folder.name

    def check_four_machines(self, program: Process, folder: str) -> None:
        wait_for(lambda: program.output().count('OUTCOME succeeded') == 4, 40.0)
        self.assertEqual(program.output().count('OUTCOME succeeded'), 4, program.output())
        told: List[ControlStatus] = []
        subscriber = rospy.Subscriber('/task/oracle/control', ControlStatus, told.append)
        self.addCleanup(subscriber.unregister)
        names = ['task', 'task_2', 'task_3', 'task_4']
        wait_for(lambda: told and len(told[-1].machines) == 4)
        self.assertEqual([machine.path for machine in told[-1].machines], names)
        pause = rospy.ServiceProxy('/task/oracle/pause', CommandMachine)
        self.assertTrue(pause('task_3', 'Ann').ok)
        self.assertTrue(
            wait_for(lambda: [each.path for each in told[-1].machines if each.paused] == ['task_3'])
        )
        program.go_on()
        self.assertEqual(program.wait(), 0, program.output())
        trials = recorded_events(folder)
        self.assertEqual(sorted(events[0].path for events in trials), names)
        self.assertEqual(
            sorted(
                {
                    event.state
                    for events in trials
                    for event in events
                    if event.kind == OracleEvent.FAILURE
                }
            ),
            ['PICK_0', 'PICK_1', 'PICK_2', 'PICK_3'],
        )

    def test_machines_that_compare_equal_or_raise_when_compared_are_told_apart(self) -> None:
        folder = self.folder()
        self.set_param('record', folder)
        program = self.start(EQUAL_MACHINES)
        expert = FrontEnd(self, '/task/expert_query')
        answered = ''
        for state in ('PICK_1', 'PICK_3'):  # those with a setting of their own ask
            question = expert.question(state=state, other_than=answered)
            self.assertIsNotNone(question, program.output())
            self.answer(expert, question)
            answered = question.query.query_id
        self.check_four_machines(program, folder)
        self.assertIn('UNWRAPPED', program.output())

    def test_machines_that_compare_equal_run_unmodified_under_oracle_run(self) -> None:
        folder = self.folder()
        self.check_four_machines(
            oracle_run(self, '--record', folder, script(self, EQUAL_MACHINES), 'bare'), folder
        )

    def test_a_machine_behind_an_action_server_recovers(self) -> None:
        task = oracle_run(self, script(self, ACTION_SERVER))
        client = actionlib.SimpleActionClient('task_server', MoveArmsAsideAction)
        self.assertTrue(client.wait_for_server(rospy.Duration(20.0)), task.output())
        client.send_goal(MoveArmsAsideGoal())
        self.assertTrue(client.wait_for_result(rospy.Duration(20.0)), task.output())
        self.assertEqual(client.get_state(), GoalStatus.SUCCEEDED)
        log = EventLog(self, 'task')
        self.assertTrue(wait_for(log.connected))
        client.send_goal(MoveArmsAsideGoal())
        self.assertEqual(log.wait_for(OracleEvent.TRIAL_END)[0].outcome, 'succeeded')


if __name__ == '__main__':
    import rostest

    rospy.init_node('oracle_library')
    rostest.rosrun('smach_oracle', 'oracle_library', LibraryTest, sys.argv)
