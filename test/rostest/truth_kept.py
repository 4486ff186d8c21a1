#!/usr/bin/env python3
"""In the graph of an experiment nobody can ask for the truth: neither operator nor robot."""

import unittest

import rosgraph
import rospy
import rosservice

from smach_oracle.srv import Judge, Recognise, RecogniseRequest, ResetWorld, Reveal, Snapshot

TRUTH = {kind._type for kind in (Reveal, Judge)}
OPERATOR = '/scripted_operator'


class TruthKept(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        for name in (
            'world/reset',
            'world/recognise',
            'perception_interface/segment',
            'manipulation_interface/finish',
        ):
            rospy.wait_for_service(name, 60.0)
        cls.master = rosgraph.Master('/truth_kept')
        rospy.wait_for_service(OPERATOR + '/get_loggers', 60.0)

    def test_no_service_of_the_graph_tells_the_truth(self):
        services = rosservice.get_service_list()
        self.assertIn('/world/recognise', services)
        self.assertEqual([name for name in services if 'reveal' in name or 'judge' in name], [])
        types = {name: rosservice.get_service_type(name) for name in services}
        self.assertEqual([name for name, kind in types.items() if kind in TRUTH], [])

    def test_the_operator_does_not_hear_of_causes(self):
        publishers, subscribers, _ = self.master.getSystemState()
        self.assertIn('/world/cause', dict(publishers))
        self.assertNotIn(OPERATOR, dict(subscribers).get('/world/cause', []))

    def test_what_people_recognise_tells_no_pose_and_is_of_an_image_that_was_published(self):
        self.assertTrue(rospy.ServiceProxy('world/reset', ResetWorld)(3).ok)
        recognise = rospy.ServiceProxy('world/recognise', Recognise)
        unknown = recognise(RecogniseRequest(rospy.Time(1), []))
        self.assertFalse(unknown.ok)
        self.assertIn('no image with the stamp', unknown.message)
        stamp = rospy.ServiceProxy('world/snapshot', Snapshot)(True).stamp
        answer = recognise(RecogniseRequest(stamp, []))
        self.assertTrue(answer.ok, answer.message)
        self.assertEqual(answer.chance, unknown.chance)
        for thing in answer.things:
            self.assertEqual(
                sorted(thing.__slots__), ['mask', 'movable', 'name', 'region', 'wanted']
            )
            self.assertEqual(
                (thing.mask.width, thing.mask.height), (thing.region.width, thing.region.height)
            )


if __name__ == '__main__':
    import rostest

    rospy.init_node('truth_kept')
    rostest.rosrun('smach_oracle', 'truth_kept', TruthKept)
