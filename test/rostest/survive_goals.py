#!/usr/bin/env python3
"""Goals of a killed program: their action server refuses to cancel them, or is gone."""

import rospy
import rostest
from actionlib.msg import TestActionGoal
from smach_ros_action_node import Behaviour
from survive_support import SurvivingCase

WAITS = 'Waits for goals of the killed program to end: /arm'
LEFT = 'a goal of /arm may still run'


class GoalsTest(SurvivingCase):
    def killed_while_moving(self, goal):
        """Kill the task while its goal runs; return all goals that are sent from now on."""
        task, _ = self.run_until_it_moves(goal=goal)
        self.kill(task)
        sent = []
        subscriber = rospy.Subscriber('/arm/goal', TestActionGoal, sent.append, queue_size=10)
        self.addCleanup(subscriber.unregister)
        return sent

    def restart_server(self):
        """Have a new server, which knows nothing of the goals of before."""
        type(self).server.start()

    def tearDown(self):
        if self.server.process.poll() is not None:
            self.restart_server()

    def test_a_server_that_does_not_cancel_is_waited_for_as_long_as_it_is_there(self):
        sent = self.killed_while_moving(Behaviour.IGNORE_CANCEL)
        again = self.run_task('--resume')
        # it says so after 10 s: a server that nobody can reach would be given up after 5 s
        self.assertTrue(again.says(WAITS, 60.0), again.output())
        self.assertNotIn(LEFT, again.output())
        self.assertFalse(sent)
        self.assertNotIn('SEEN', again.output())
        self.server.stop()
        self.assertTrue(again.says(LEFT, 40.0), again.output())

    def test_a_server_that_is_gone_is_not_waited_for(self):
        sent = self.killed_while_moving(Behaviour.HANG)
        self.server.stop()
        again = self.run_task('--resume')
        self.assertTrue(again.says(LEFT, 60.0), again.output())
        self.assertNotIn(WAITS, again.output())  # which it says after 10 s
        self.restart_server()
        self.assertTrue(again.says('OUTCOME succeeded', 40.0), again.output())
        self.assertEqual(len(sent), 1)


if __name__ == '__main__':
    rospy.init_node('survive_goals')
    rostest.rosrun('smach_oracle', 'survive_goals', GoalsTest)
