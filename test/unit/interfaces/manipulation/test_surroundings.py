"""Maps of boxes that come over the wire: what is no box leaves the surroundings as they were."""

import math
from types import SimpleNamespace

import pytest
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
from std_msgs.msg import Header
from test_clearance import URDF

from smach_oracle.geometry.chain import JointChain
from smach_oracle.interfaces.manipulation.surroundings import Surroundings
from smach_oracle.interfaces.manipulation.teleoperated_arm import DescribedRobot
from smach_oracle.msg import CollisionBoxes


@pytest.fixture(name='near')
def make_near():
    """Replaces the map, and tells what the hand of the slider is near, 1 m before its base."""
    robot = DescribedRobot(URDF, 'base', SimpleNamespace(now=lambda: ({'slide': 0.0}, None)))
    surroundings = Surroundings(robot, 0.3)
    told = []
    surroundings.watch_over(
        SimpleNamespace(chain=JointChain.from_urdf(URDF, 'base', 'hand'), watch=told.append)
    )

    def near(message):
        surroundings.replace(message)
        surroundings.update()
        return [(round(each.distance, 3), each.between) for each in told[0]([0.0])]

    return near


def boxes(
    at=(1.2, 0.0, 0.0), turn=(0, 0, 0, 1), size=(0.1, 0.1, 0.1), frame='base', names=('box',)
):
    return CollisionBoxes(
        Header(frame_id=frame),
        'map',
        list(names),
        [Pose(Point(*at), Quaternion(*turn))],
        [Vector3(*size)],
    )


@pytest.mark.parametrize(
    'bad',
    [
        {'size': (math.nan, 0.1, 0.1)},
        {'size': (0.1, 0.1, math.nan)},
        {'size': (0.1, math.inf, 0.1)},
        {'size': (0.1, 0.1, 0.0)},
        {'at': (math.nan, 0, 0)},
        {'turn': (0, 0, 0, 0)},
        {'frame': 'moon'},
        {'names': ()},
    ],
)
def test_a_map_that_is_none_leaves_the_one_before(near, bad):
    assert near(boxes()) == [(0.1, 'hand and box')]
    assert near(boxes(**bad)) == [(0.1, 'hand and box')]
    assert near(boxes(at=(1.25, 0.0, 0.0))) == [(0.15, 'hand and box')]
