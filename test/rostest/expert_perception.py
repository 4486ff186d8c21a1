#!/usr/bin/env python3
"""The perception interface as a front end and the oracle see it: frames, marks, what accepting
hands over, refusals.
"""

import os
import sys
import unittest

import actionlib
import numpy as np
import rospy
import rostest
from actionlib_msgs.msg import GoalStatus
from geometry_msgs.msg import Point32, Polygon, PoseStamped, Vector3
from sensor_msgs.msg import Image, PointCloud2, RegionOfInterest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from published_camera import PublishedCamera
from waiting import wait_for

from smach_oracle.msg import SegmentStroke, SharedAutonomyAction, SharedAutonomyGoal
from smach_oracle.ros.images import colour_of
from smach_oracle.ros.userdata_codec import decode_all, encode_all
from smach_oracle.simulation.scenes.scene import Body
from smach_oracle.srv import (
    FinishInterface,
    GiveUpInterface,
    SegmentObject,
    SegmentObjectRequest,
    UseFrame,
    UseFrameRequest,
)

LIMIT = rospy.Duration(30.0)
TABLE = Body('table', 'box', (0.7, 1.4, 0.04), (0.85, 0.0, 0.70), colour=(0.55, 0.38, 0.22))
CAN = Body('can', 'cylinder', (0.031, 0.031, 0.12), (0.80, 0.10, 0.78), colour=(0.1, 0.3, 0.9))
BOX = Body('box', 'box', (0.05, 0.05, 0.14), (0.68, -0.15, 0.79), colour=(0.2, 0.8, 0.2))
SCENE = [TABLE, CAN, BOX]
CAN_INDEX = 1


def goal_for(state, query='q', output_keys=('table', 'objects', 'sizes')):
    return SharedAutonomyGoal(
        query_id=query,
        state=state,
        interface='perception',
        output_keys=list(output_keys),
        outcomes=['succeeded', 'aborted', 'preempted'],
    )


class Interface:
    """One node's interface, and the goal that is open there."""

    def __init__(self, name):
        self.client = actionlib.ActionClient(name, SharedAutonomyAction)
        self.images = []
        self.segment, self.use_frame, self.finish, self.give_up = (
            rospy.ServiceProxy('{}/{}'.format(name, each), spec)
            for each, spec in (
                ('segment', SegmentObject),
                ('use_frame', UseFrame),
                ('finish', FinishInterface),
                ('give_up', GiveUpInterface),
            )
        )
        for service in (self.segment, self.use_frame, self.finish, self.give_up):
            service.wait_for_service(30.0)
        rospy.Subscriber(name + '/image', Image, self.images.append)
        if not self.client.wait_for_server(LIMIT):
            raise RuntimeError('no action ' + name)

    def start(self, goal):
        del self.images[:]
        handle = self.client.send_goal(goal)
        if not wait_for(lambda: handle.get_goal_status() != GoalStatus.PENDING):
            raise RuntimeError('the goal stays pending')
        return handle

    def ended(self, handle):
        wait_for(lambda: handle.get_comm_state() == actionlib.CommState.DONE)
        return handle.get_goal_status()

    def shown(self):
        """The frame that a front end is shown."""
        wait_for(lambda: self.images)
        return self.images[-1]


class PerceptionInterface(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.camera = PublishedCamera('head_camera', SCENE, streams=True)
        cls.interface = Interface('perception_interface')

    def setUp(self):
        self.camera.show(SCENE)
        self.handle = None

    def tearDown(self):
        if self.handle is not None and self.handle.get_comm_state() != actionlib.CommState.DONE:
            self.handle.cancel()
            self.interface.ended(self.handle)

    def begin(self, state='DETECT_TABLETOP', **keys):
        self.handle = self.interface.start(goal_for(state, **keys))
        self.assertEqual(self.handle.get_goal_status(), GoalStatus.ACTIVE)
        return self.interface.shown()

    def around(self, index=CAN_INDEX, margin=6):
        rows, columns = np.nonzero(self.camera.pixels(index))
        return RegionOfInterest(
            x_offset=columns.min() - margin,
            y_offset=rows.min() - margin,
            width=np.ptp(columns) + 2 * margin,
            height=np.ptp(rows) + 2 * margin,
        )

    def segment(self, **fields):
        return self.interface.segment(SegmentObjectRequest(**fields))

    def near(self, pose, body):
        found = np.array([pose.pose.position.x, pose.pose.position.y, pose.pose.position.z])
        self.assertEqual(pose.header.frame_id, 'base_footprint')
        self.assertLess(np.linalg.norm(found - body.position), 0.015)

    def test_a_marked_object_gives_the_outputs_of_a_detection_and_comes_first(self):
        image = self.begin()
        answer = self.segment(stamp=image.header.stamp, region=self.around())
        self.assertTrue(answer.ok, answer.message)
        self.near(answer.object, CAN)
        mask = colour_of(answer.mask)[:, :, 0] > 0
        truth = self.camera.pixels(CAN_INDEX)
        self.assertGreater((mask & truth).sum() / (mask | truth).sum(), 0.9)
        self.assertEqual(answer.cloud.header, answer.object.header)
        self.assertGreater(answer.cloud.width, 500)
        self.assertTrue(self.interface.finish(outcome='succeeded', text='marked').ok)
        self.assertEqual(self.interface.ended(self.handle), GoalStatus.SUCCEEDED)
        result = self.handle.get_result()
        outputs = decode_all(result.outputs)
        self.assertEqual(
            (result.outcome, sorted(outputs)), ('succeeded', ['objects', 'sizes', 'table'])
        )
        self.near(outputs['objects'][0], CAN)
        self.near(outputs['objects'][1], BOX)
        self.assertEqual(len(outputs['sizes']), 2)
        self.assertAlmostEqual(outputs['sizes'][0].z, 0.12, delta=0.01)
        self.assertAlmostEqual(outputs['table'].pose.position.z, 0.72, delta=0.01)
        self.assertEqual(outputs['objects'][0].header.stamp, image.header.stamp)

    def test_another_state_gets_what_its_own_template_says(self):
        self.begin('DETECT_DRINK', output_keys=['drink', 'size'])
        self.assertTrue(
            self.segment(polygon=Polygon([Point32(*corner) for corner in self.corners()])).ok
        )
        self.assertTrue(self.interface.finish(outcome='succeeded', text='').ok)
        self.interface.ended(self.handle)
        outputs = decode_all(self.handle.get_result().outputs)
        self.assertEqual(sorted(outputs), ['drink', 'size'])
        self.near(outputs['drink'], CAN)

    def corners(self):
        box = self.around()
        right, bottom = box.x_offset + box.width, box.y_offset + box.height
        left, top = box.x_offset, box.y_offset
        return [(left, top, 0), (right, top, 0), (right, bottom, 0), (left, bottom, 0)]

    def test_the_frame_of_the_goal_stays_while_the_world_goes_on(self):
        first = self.begin()
        region = self.around()
        self.camera.show([TABLE, BOX])
        self.assertTrue(
            self.segment(region=region).ok, 'in the image in which the state failed, it is there'
        )
        fresh = self.interface.use_frame(UseFrameRequest.FRESH)
        self.assertTrue(fresh.ok, fresh.message)
        self.assertGreater(fresh.stamp, first.header.stamp)
        self.assertTrue(wait_for(lambda: self.interface.images[-1].header.stamp == fresh.stamp))
        self.assertFalse(self.segment(region=region).ok, 'now it is gone')
        stale = self.segment(region=region, stamp=first.header.stamp)
        self.assertIn('is in use', stale.message)
        self.assertFalse(
            self.interface.finish(outcome='succeeded', text='').ok,
            'nothing is marked in this image',
        )
        again = self.interface.use_frame(UseFrameRequest.AT_GOAL)
        self.assertEqual(again.stamp, first.header.stamp)
        self.assertTrue(self.segment(region=region, stamp=first.header.stamp).ok)

    def test_what_is_drawn_wrongly_is_answered_with_what_is_wrong(self):
        self.begin()
        outside = self.segment(
            region=RegionOfInterest(x_offset=900, y_offset=10, width=50, height=50)
        )
        self.assertIn('outside the image', outside.message)
        self.assertIn('no region', self.segment().message)
        row, column = np.argwhere(self.camera.pixels(CAN_INDEX)).mean(axis=0)
        rubbed_out = SegmentStroke(False, [Point32(column, row, 0)], 300.0)
        self.assertIn('collapsed', self.segment(region=self.around(), strokes=[rubbed_out]).message)
        refused = self.interface.finish(outcome='succeeded', text='')
        self.assertFalse(refused.ok)
        self.assertIn(
            'no object is marked, so objects, sizes, table cannot be filled in', refused.message
        )
        self.assertIn('allowed', self.interface.finish(outcome='shattered', text='').message)
        self.assertIn('unknown', self.interface.use_frame(7).message)
        self.assertTrue(
            self.interface.finish(outcome='aborted', text='there is none').ok,
            'a failure needs no object',
        )
        self.interface.ended(self.handle)
        self.assertEqual(self.handle.get_result().outcome, 'aborted')

    def test_who_gives_every_output_himself_need_mark_nothing(self):
        self.begin()
        given = encode_all({'table': PoseStamped(), 'objects': [PoseStamped()]})
        refused = self.interface.finish(outcome='succeeded', outputs=given)
        self.assertIn('so sizes cannot be filled in', refused.message)
        given += encode_all({'sizes': [Vector3(1, 2, 3)]})
        self.assertTrue(self.interface.finish(outcome='succeeded', outputs=given).ok)
        self.interface.ended(self.handle)
        self.assertEqual(decode_all(self.handle.get_result().outputs)['sizes'][0].z, 3)

    def test_the_cloud_of_the_frame_in_use_is_told_in_the_frame_of_the_base(self):
        clouds = []
        subscriber = rospy.Subscriber('perception_interface/cloud', PointCloud2, clouds.append)
        self.begin()
        stamp = self.interface.shown().header.stamp
        self.assertTrue(wait_for(lambda: clouds and clouds[-1].header.stamp == stamp))
        subscriber.unregister()
        points = np.frombuffer(clouds[-1].data, '<f4').reshape(-1, clouds[-1].point_step // 4)[
            :, :3
        ]
        self.assertEqual(clouds[-1].header.frame_id, 'base_footprint')
        self.assertAlmostEqual(
            np.median(points[:, 2]), 0.72, delta=0.03, msg='the top of the table'
        )

    def test_one_goal_at_a_time_and_only_for_states_that_it_knows(self):
        self.begin()
        second = self.interface.start(goal_for('DETECT_TABLETOP', 'q2'))
        self.assertEqual(self.interface.ended(second), GoalStatus.REJECTED)
        self.assertIn('one goal at a time', second.get_goal_status_text())
        self.assertTrue(self.interface.give_up(text='too dark').ok)
        self.assertEqual(self.interface.ended(self.handle), GoalStatus.ABORTED)
        unknown = self.interface.start(goal_for('DANCE'))
        self.assertEqual(self.interface.ended(unknown), GoalStatus.REJECTED)
        self.assertIn('DETECT_DRINK, DETECT_TABLETOP', unknown.get_goal_status_text())

    def test_a_preempt_ends_it_and_the_services_say_so(self):
        self.begin()
        self.handle.cancel()
        self.assertEqual(self.interface.ended(self.handle), GoalStatus.PREEMPTED)
        for answer in (
            self.segment(region=self.around()),
            self.interface.use_frame(UseFrameRequest.FRESH),
            self.interface.finish(outcome='succeeded', text=''),
            self.interface.give_up(text=''),
        ):
            self.assertFalse(answer.ok)
            self.assertIn('no goal is active', answer.message)

    def test_a_camera_that_is_not_there_is_named(self):
        blind = Interface('blind')
        handle = blind.start(goal_for('DETECT_TABLETOP'))
        self.assertIn('nobody publishes /nowhere/rgb', blind.segment(region=self.around()).message)
        self.assertIn('nobody publishes', blind.use_frame(UseFrameRequest.AT_GOAL).message)
        self.assertTrue(blind.give_up(text='no picture').ok)
        self.assertEqual(blind.ended(handle), GoalStatus.ABORTED)

    def test_a_robot_that_takes_snapshots_is_asked_for_one(self):
        camera = PublishedCamera('snapping_camera', SCENE, streams=False)
        interface = Interface('snapping')
        handle = interface.start(goal_for('DETECT_DRINK', output_keys=['drink', 'size']))
        first = interface.shown()
        self.assertGreaterEqual(camera.shots, 1)
        fresh = interface.use_frame(UseFrameRequest.FRESH)
        self.assertTrue(fresh.ok, fresh.message)
        self.assertGreater(fresh.stamp, first.header.stamp)
        self.assertTrue(interface.give_up(text='seen').ok)
        interface.ended(handle)


if __name__ == '__main__':
    rospy.init_node('expert_perception')
    rostest.rosrun('smach_oracle', 'expert_perception', PerceptionInterface)
