"""Outputs of an answer that no robot could read are refused before the question is settled."""

import re

import pytest
import rospy
from expert_fixtures import make_question
from std_msgs.msg import Empty

from smach_oracle.msg import ExpertDecision, UserdataItem
from smach_oracle.oracle.errors import AnswerError
from smach_oracle.ros.expert.answer_rules import check_decision
from smach_oracle.ros.expert.question_messages import to_goal
from smach_oracle.ros.userdata_codec import encode


def decision(**fields):
    """A decision whose output is a std_msgs/Empty, with other fields than it should have."""
    item = encode('grasped', Empty())
    for name, value in fields.items():
        setattr(item, name, value)
    return ExpertDecision(
        kind=ExpertDecision.SUPERSEDE, outcome='succeeded', by='ann', outputs=[item]
    )


@pytest.mark.parametrize(
    'fields, text',
    [
        ({'type': ''}, "'grasped': the type .* is missing, such as"),
        ({'type': 'PoseStamped'}, "'PoseStamped' is not the name of a message type"),
        ({'md5sum': ''}, "md5sum '' .* is wrong. `rosmsg md5 std_msgs/Empty` prints it"),
        ({'md5sum': '*'}, "md5sum '\\*' .* is wrong"),
        ({'value': b'12'}, 'are not those of a std_msgs/Empty'),
        (
            {'encoding': UserdataItem.ROS_MESSAGES, 'value': b'1', 'type': 'their_robot/Thing'},
            'cut off at byte 0',
        ),
        ({'encoding': UserdataItem.JSON, 'value': b'[1e999]'}, '1e999 is too large for a number'),
        ({'encoding': UserdataItem.JSON, 'value': b'Infinity'}, 'Infinity is not a JSON number'),
    ],
)
def test_what_is_wrong_or_missing_is_said(fields, text):
    question = to_goal(make_question('q1'), '/robot', rospy.Time(1))
    with pytest.raises(AnswerError) as caught:
        check_decision(question, decision(**fields))
    assert re.search(text, str(caught.value)), caught.value


@pytest.mark.parametrize(
    'fields',
    [
        {},
        {'type': 'their_robot/Thing', 'value': b'12'},
        {'md5sum': '0' * 32, 'value': b'12'},  # another release's, perhaps the robot's
    ],
)
def test_types_that_are_not_installed_here_are_left_to_the_robot(fields):
    question = to_goal(make_question('q1'), '/robot', rospy.Time(1))
    assert check_decision(question, decision(**fields)) is None
