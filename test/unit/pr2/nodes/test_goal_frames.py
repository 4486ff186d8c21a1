"""Poses of goals: what lies too far away is refused, however far."""

import warnings

import pytest
from geometry_msgs.msg import Point, PointStamped
from std_msgs.msg import Header

from smach_oracle.pr2.nodes.frames import point_in_base
from smach_oracle.pr2.planning.arm import SkillError


class UnusedRobot:
    """A fake: a point in base_footprint needs no robot."""


@pytest.mark.parametrize('far', [101.0, 1.7e308])
def test_a_point_too_far_away_is_refused_without_a_warning(far):
    message = PointStamped(Header(frame_id='base_footprint'), Point(far, 0.0, 0.0))
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        with pytest.raises(
            SkillError,
            match=r'target: \({:.6g}, 0, 0\) m is more than'.format(far).replace('+', r'\+'),
        ):
            point_in_base(message, UnusedRobot(), 'target')
