"""The messages that stand in for upstream's are upstream's to every other node: the same sums."""

import pytest

import control_msgs.msg
import smach_msgs.msg

SUMS = {
    control_msgs.msg.FollowJointTrajectoryAction: 'bc4f9b743838566551c0390c65f1a248',
    control_msgs.msg.GripperCommandAction: '950b2a6ebe831f5d4f4ceaba3d8be01e',
    control_msgs.msg.PointHeadAction: '7252920f1243de1b741f14f214125371',
    control_msgs.msg.SingleJointPositionAction: 'c4a786b7d53e5d0983decf967a5a779e',
    smach_msgs.msg.SmachContainerStatus: '5ba2bb79ac19e3842d562a191f2a675b',
    smach_msgs.msg.SmachContainerStructure: '3d3d1e0d0f99779ee9e58101a5dcf7ea',
    smach_msgs.msg.SmachContainerInitialStatusCmd: '45f8cf31fc29b829db77f23001f788d6',
}


@pytest.mark.parametrize('message', SUMS, ids=lambda message: message._type)
def test_a_message_has_the_sum_that_upstreams_has(message):
    assert message._md5sum == SUMS[message]
