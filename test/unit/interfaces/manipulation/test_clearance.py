"""Distances of an arm to the robot's own body and to boxes, on a robot of boxes whose distances are
plain to see.
"""

import numpy as np
import pytest

from smach_oracle.geometry.chain import JointChain
from smach_oracle.geometry.transforms import transform
from smach_oracle.interfaces.manipulation.clearance import (
    ClearanceError,
    ClearanceModel,
    CollisionBox,
)

LINK = (
    '<link name="{0}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" '
    'iyz="0"/>'
    '</inertial><collision><geometry><box size="{1}"/></geometry></collision></link>'
)
JOINT = (
    '<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/><origin xyz="{4}"/><axis '
    'xyz="{5}"/>'
    '<limit lower="-1" upper="1" velocity="1" effort="1"/></joint>'
)
# a slide along x carries a hand, 1 m before a body; a mast of the body stands 0.5 m to the left
URDF = '<robot name="slider">{}</robot>'.format(
    ''.join(
        [
            LINK.format('base', '0.2 0.2 0.2'),
            LINK.format('hand', '0.1 0.1 0.1'),
            LINK.format('mast', '0.1 0.1 0.1'),
            JOINT.format('slide', 'prismatic', 'base', 'hand', '1 0 0', '1 0 0'),
            JOINT.format('foot', 'fixed', 'base', 'mast', '1 0.5 0', '1 0 0'),
        ]
    )
)


@pytest.fixture(name='model')
def make_model():
    model = ClearanceModel(URDF, 'base')
    yield model
    model.close()


@pytest.fixture(name='arm')
def make_arm():
    return JointChain.from_urdf(URDF, 'base', 'hand')


def test_the_robots_own_body_is_seen_and_must_not_be_touched(model, arm):
    (nearest,) = model.arm(arm, 0.42)(np.array([0.0]))
    assert nearest.distance == pytest.approx(0.4, abs=1e-3) and not nearest.touchable
    assert nearest.between == 'hand and mast'


def test_a_box_is_seen_in_the_frame_it_is_given_in_until_it_is_replaced(model, arm):
    near = model.arm(arm, 0.2)
    assert near(np.array([0.0])) == []
    model.set_boxes([CollisionBox('table', transform([1.0, 0.0, -0.2]), (1.0, 1.0, 0.1))])
    (nearest,) = near(np.array([0.0]))
    assert nearest.distance == pytest.approx(0.1, abs=1e-3) and nearest.touchable
    assert nearest.between == 'hand and table'
    model.set_boxes([])
    assert near(np.array([0.0])) == []


def test_a_box_below_the_standing_part_alone_is_no_business_of_the_arm(model, arm):
    model.set_boxes([CollisionBox('floor', transform([0.0, 0.0, -0.15]), (0.2, 0.2, 0.05))])
    assert model.arm(arm, 0.3)(np.array([0.5])) == []


def test_neighbours_that_are_always_near_are_left_out(model, arm):
    assert model.arm(arm, 2.0)(np.array([0.0])) == []


def test_a_model_that_cannot_be_loaded_or_lacks_the_frame_is_refused():
    with pytest.raises(ClearanceError, match='no link .nowhere.'):
        ClearanceModel(URDF, 'nowhere')
    with pytest.raises(ValueError, match='meshes'):
        ClearanceModel(
            URDF.replace('<box size="0.1 0.1 0.1"/>', '<mesh filename="missing.stl"/>'), 'base'
        )
