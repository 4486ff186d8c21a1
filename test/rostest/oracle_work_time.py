#!/usr/bin/env python3
"""Under simulated time the minutes by which ways are priced are those of the world, which is here
what the test publishes on /clock.
"""

import sys
import unittest
from typing import Any, Dict, List

import rospy
from rosgraph_msgs.msg import Clock
from waiting import wait_for

import smach
from smach_oracle import OracleContainer
from smach_oracle.oracle import oracle_of
from smach_oracle.oracle.decision.ways import Way, WayKind
from smach_oracle.oracle.records.events import Event, EventKind


class OracleWorkTime(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        cls.clock = rospy.Publisher('/clock', Clock, queue_size=10)

    def set_clock(self, seconds: float) -> None:
        stamp = rospy.Time.from_sec(seconds)
        self.assertTrue(
            wait_for(lambda: self.clock.publish(stamp) or rospy.get_rostime() == stamp, 20.0)
        )

    def state(self, *visits: Any) -> smach.CBState:
        """Each visit has an outcome, and the world's times that come in it."""
        left = list(visits)

        def visit(_: smach.UserData) -> str:
            outcome, *times = left.pop(0)
            for seconds in times:
                self.set_clock(seconds)
            return outcome

        return smach.CBState(visit, outcomes=['succeeded', 'aborted'])

    def run_machine(self, look: smach.State, grasp: smach.State) -> List[Event]:
        """Return the decisions of a trial that ends well."""
        machine = smach.StateMachine(['succeeded', 'aborted'])
        with machine:
            smach.StateMachine.add('LOOK', look, {'succeeded': 'GRASP'})
            smach.StateMachine.add('GRASP', grasp)
        OracleContainer.wrap(machine, settings={'policy': 'escalating'}, name=self._testMethodName)
        decisions: List[Event] = []
        oracle_of(machine).events.observers.append(
            lambda event: event.kind is EventKind.DECISION and decisions.append(event)
        )
        self.assertEqual(machine.execute(), 'succeeded')
        return decisions

    def test_the_ways_of_a_menu_have_the_minutes_of_the_world(self) -> None:
        self.set_clock(100.0)
        (decision,) = self.run_machine(
            self.state(('succeeded', 112.0), ('succeeded', 300.0)),
            self.state(('aborted', 124.0), ('succeeded', 310.0)),
        )
        minutes = minutes_of(decision)
        self.assertAlmostEqual(minutes['again'], 0.2, 3)
        self.assertAlmostEqual(minutes['from LOOK'], 0.4, 3)
        self.assertAlmostEqual(minutes['wait 10 s'], 0.2 + 10 / 60, 3)

    def test_a_world_that_jumps_back_or_stands_still_takes_no_minutes_back(self) -> None:
        self.set_clock(500.0)
        first, second = self.run_machine(
            self.state(('succeeded', 512.0, 20.0), ('succeeded',), ('succeeded',)),
            self.state(('aborted', 32.0), ('aborted', 5.0), ('succeeded',)),
        )
        self.assertLess(minutes_of(first)['again'], 0.201)
        self.assertGreaterEqual(second.data['streak']['minutes'], 0.0)

    def test_a_wait_takes_its_seconds_while_the_world_stands_still(self) -> None:
        self.set_clock(900.0)
        _, second, third = self.run_machine(
            self.state(*[('succeeded',)] * 4),
            self.state(('aborted', 906.0), ('aborted',), ('aborted',), ('succeeded',)),
        )
        self.assertEqual(second.data['order'][0], 'wait 10 s')
        self.assertEqual(second.data['streak']['minutes'], 0.0)
        self.assertAlmostEqual(third.data['streak']['minutes'], 10 / 60, 2)


def minutes_of(decision: Event) -> Dict[str, float]:
    """The minutes of each way of its menu."""
    assert decision.data is not None
    ways = [Way(**{**each, 'kind': WayKind(each['kind'])}) for each in decision.data['menu']]
    return {way.key: way.minutes for way in ways}


if __name__ == '__main__':
    import rostest

    rospy.init_node('oracle_work_time')
    rostest.rosrun('smach_oracle', 'oracle_work_time', OracleWorkTime, sys.argv)
