#!/usr/bin/env python3
"""What viewers see of wrapped machines, of either engine, beside what else a script has made."""

import sys
import unittest

import actionlib
import rosgraph
import rospy
from oracle_support import Process, script
from waiting import stays, wait_for

from smach_msgs.msg import SmachContainerStatus, SmachContainerStructure
from smach_oracle.expert.console.robots.followed_robots import FollowedRobots
from smach_oracle.expert.console.trials.trial_log import TrialLog
from smach_oracle.expert.console.web.sections import PageSections
from smach_oracle.msg import MoveArmsAsideAction, MoveArmsAsideGoal

STRUCTURE = '/task/smach/container_structure'
PRELUDE = """
import sys, threading, rospy, smach, smach_ros
from smach_oracle import OracleContainer
OUTCOMES = ['succeeded', 'aborted', 'preempted']
def chain(*states):
    sm = smach.StateMachine(outcomes=OUTCOMES)
    with sm:
        for number, state in enumerate(states):
            following = 'S%d' % (number + 1) if state is not states[-1] else 'succeeded'
            smach.StateMachine.add('S%d' % number, state, {'succeeded': following})
    return sm
def step():
    return smach.CBState(lambda ud: 'succeeded', outcomes=['succeeded', 'aborted'])
rospy.init_node('task')
"""
A_TREE = (
    PRELUDE
    + """
sm = OracleContainer.wrap(chain(*[chain(step()) for _ in range(30)]), name='TREE')
print('OUTCOME {}'.format(sm.execute()), flush=True)
names = [thread.name for thread in threading.enumerate()]
print('INTROSPECTION', sum('introspection' in name for name in names),
      'PUBLISHERS', sum('_publisher' in name for name in names), flush=True)
sys.stdin.readline()
"""
)
STOPPED_BEFORE = (
    PRELUDE
    + """
sm = chain(step())
viewer = smach_ros.IntrospectionServer('mine', sm, '/MINE')
viewer.start()
viewer.stop()
print('OUTCOME {}'.format(OracleContainer.wrap(sm, name='TREE').execute()), flush=True)
sys.stdin.readline()
"""
)
BEHIND_AN_ACTION_SERVER = (
    PRELUDE
    + """
from smach_oracle.msg import MoveArmsAsideAction
sm = OracleContainer.wrap(chain(step()), name='TREE')
smach_ros.ActionServerWrapper('task_server', MoveArmsAsideAction, sm, ['succeeded'], ['aborted'],
                              ['preempted']).run_server()
rospy.spin()
"""
)
IN_A_VIEWED_MACHINE = (
    PRELUDE
    + """
inner = OracleContainer.wrap(chain(step(), step()), name='INNER')
sm = chain(inner)
viewer = smach_ros.IntrospectionServer('task', sm, '/OUTER')
viewer.start()
print('OUTCOME {}'.format(sm.execute()), flush=True)
sys.stdin.readline()
viewer.stop()
"""
)
OWN_SERVER = (
    PRELUDE
    + """
sm = chain(step(), chain(step(), step()), step())
viewer = smach_ros.IntrospectionServer('mine', sm, '/SM_ROOT')
if WHEN == 'before':
    viewer.start()
OracleContainer.wrap(sm, name='TREE')
print('OUTCOME {}'.format(sm.execute()), flush=True)
if WHEN == 'after':
    viewer.start()
sys.stdin.readline()
print('AGAIN {}'.format(sm.execute()), flush=True)
sys.stdin.readline()
viewer.stop()
"""
)


class Console:
    """The robots that a console finds, without its page."""

    def __init__(self):
        self._sections = PageSections()
        self._robots = FollowedRobots(self._sections, TrialLog(), self)

    def find(self, text, done):
        """Lay out nothing."""

    def listed(self):
        self._robots.discover()
        self._robots.write_sections()
        return self._sections.get('robots')

    def knows_both(self):
        """Whether the script's own server has told of its machine, and so has the oracle."""
        self.listed()
        known = self._robots._robots
        return all(
            name in known and known[name].source(frozenset()).states for name in ('/mine', '/task')
        )

    def close(self):
        for subscribers in self._robots._subscribers.values():
            for each in subscribers:
                each.unregister()


class ShownTest(unittest.TestCase):
    def start(self, text: str) -> Process:
        program = Process([sys.executable, script(self, text)])
        self.addCleanup(program.stop)
        self.shown = {}
        viewer = rospy.Subscriber(
            STRUCTURE,
            SmachContainerStructure,
            lambda message: self.shown.update({message.path: message}),
        )
        self.addCleanup(viewer.unregister)
        return program

    def test_a_tree_is_shown_whole_by_one_thread(self) -> None:
        program = self.start(A_TREE)
        self.assertTrue(program.says('OUTCOME succeeded'), program.output())
        self.assertTrue(wait_for(lambda: len(self.shown) == 31), sorted(self.shown))
        for path in ['/TREE'] + ['/TREE/S{}'.format(number) for number in range(30)]:
            self.assertIn('ORACLE', self.shown[path].children)
        self.assertTrue(program.says('INTROSPECTION 1 PUBLISHERS 0'), program.output())
        program.go_on()
        self.assertEqual(program.wait(), 0, program.output())

    def test_a_server_that_was_stopped_keeps_no_machine_from_being_shown(self) -> None:
        program = self.start(STOPPED_BEFORE)
        self.assertTrue(program.says('OUTCOME succeeded'), program.output())
        self.assertTrue(wait_for(lambda: '/TREE' in self.shown, 20.0), program.output())
        program.go_on()

    def test_a_machine_behind_an_action_server_is_shown(self) -> None:
        program = self.start(BEHIND_AN_ACTION_SERVER)
        client = actionlib.SimpleActionClient('task_server', MoveArmsAsideAction)
        self.assertTrue(client.wait_for_server(rospy.Duration(40.0)), program.output())
        client.send_goal(MoveArmsAsideGoal())
        self.assertTrue(client.wait_for_result(rospy.Duration(40.0)), program.output())
        self.assertTrue(wait_for(lambda: '/TREE' in self.shown, 20.0), program.output())

    def test_a_wrapped_machine_in_one_that_is_viewed_is_shown_there_alone(self) -> None:
        program = self.start(IN_A_VIEWED_MACHINE)
        self.assertTrue(program.says('OUTCOME succeeded'), program.output())
        self.assertTrue(
            wait_for(lambda: set(self.shown) == {'/OUTER', '/OUTER/S0'}), sorted(self.shown)
        )
        publishers = dict(rosgraph.Master('/test').getSystemState()[0])
        self.assertEqual(
            [topic for topic in publishers if topic.endswith('container_structure')], [STRUCTURE]
        )
        program.go_on()
        self.assertEqual(program.wait(), 0, program.output())

    def test_a_console_lists_a_machine_once_that_its_script_shows_from_the_start(self) -> None:
        self.assert_listed_once(OWN_SERVER.replace('WHEN', repr('before')))

    def test_a_console_lists_a_machine_once_that_its_script_shows_later(self) -> None:
        self.assert_listed_once(OWN_SERVER.replace('WHEN', repr('after')))

    def assert_listed_once(self, text: str) -> None:
        program, console = self.start(text), Console()
        self.addCleanup(console.close)
        self.assertTrue(program.says('OUTCOME succeeded'), program.output())
        self.assertTrue(wait_for(console.knows_both), program.output())
        self.assertTrue(wait_for(lambda: console.listed() == ['/task']), console.listed())
        self.assertTrue(stays(lambda: console.listed() == ['/task'], 2.5), 'over a heartbeat')
        status = rospy.wait_for_message('/mine/smach/container_status', SmachContainerStatus, 20.0)
        self.assertTrue(status.path.startswith('/SM_ROOT'), 'its own server goes on')
        program.go_on()
        self.assertTrue(program.says('AGAIN succeeded'), program.output())
        self.assertEqual(console.listed(), ['/task'])
        program.go_on()
        self.assertEqual(program.wait(), 0, program.output())


if __name__ == '__main__':
    import rostest

    rospy.init_node('oracle_introspection')
    rostest.rosrun('smach_oracle', 'oracle_introspection', ShownTest, sys.argv)
