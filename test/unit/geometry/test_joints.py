"""How joints move: as matrices, one by one and many at once, and as tf has it; held against
rotation vectors.
"""

import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_chain import arm_urdf

from smach_oracle.geometry.joints import Joint, moved, origin_of, placed_parts, read_joints
from smach_oracle.geometry.transform_tree import TransformTree
from smach_oracle.geometry.transforms import from_quaternion, from_rpy, rotation_about

TILTED = arm_urdf().replace(
    'rpy="0 0 0"/><axis xyz="0 0 1"', 'rpy="0.3 -0.5 0.7"/><axis xyz="0.2 -1 3"'
)


def by_rotation_vector(joint: Joint, position: float) -> np.ndarray:
    """4x4, the joint's parent from its child."""
    motion = np.eye(4)
    if joint.kind == 'prismatic':
        motion[:3, 3] = joint.axis * position
    elif joint.kind != 'fixed':
        motion[:3, :3] = Rotation.from_rotvec(joint.axis * position).as_matrix()
    return joint.origin @ motion


@pytest.mark.parametrize('position', [0.0, 0.4, -2.9, 7.0])
def test_a_joint_moves_about_its_axis_or_along_it(position):
    joints = list(read_joints(TILTED).values())
    assert {joint.kind for joint in joints} == {'prismatic', 'revolute', 'continuous', 'fixed'}
    expected = np.array([by_rotation_vector(joint, position) for joint in joints])
    one_by_one = np.array([joint.origin @ joint.motion(position) for joint in joints])
    np.testing.assert_allclose(one_by_one, expected, rtol=0, atol=1e-12)
    moving = [joint for joint in joints if joint.moves]
    together = moved(
        placed_parts(moving, [joint.origin for joint in moving]),
        np.array([joint.turns for joint in moving]),
        np.full((2, len(moving)), position),
    )
    for found in together:
        np.testing.assert_allclose(
            found, expected[[joint.moves for joint in joints]], rtol=0, atol=1e-12
        )


def test_as_tf_has_them_links_are_at_the_same_places():
    joints = read_joints(TILTED)
    positions = {
        joint.name: 0.1 * number - 0.3
        for number, joint in enumerate(joints.values())
        if joint.moves
    }
    tree = TransformTree(TILTED, list(positions))
    links = tree.moving(positions) + tree.fixed
    assert {link.child for link in links} == set(joints)
    for link in links:
        joint = joints[link.child]
        assert link.parent == joint.parent
        np.testing.assert_allclose(
            from_quaternion(link.position, link.turn),
            joint.origin @ joint.motion(positions.get(joint.name, 0.0)),
            rtol=0,
            atol=1e-12,
        )


def test_a_joint_that_is_not_measured_counts_as_fixed_at_zero():
    tree = TransformTree(TILTED, ['pan'])
    assert tree.names == ['pan'] and 'lift_link' in {link.child for link in tree.fixed}


def test_a_turn_about_an_axis():
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    np.testing.assert_allclose(
        rotation_about(axis, 0.8), Rotation.from_rotvec(0.8 * axis).as_matrix(), atol=1e-12
    )


def test_an_origin_is_read_or_the_identity():
    shape = ElementTree.fromstring('<visual><origin xyz="1 2 3" rpy="0 0 0.5"/></visual>')
    np.testing.assert_allclose(origin_of(shape), from_rpy((1, 2, 3), yaw=0.5))
    assert (origin_of(ElementTree.fromstring('<visual/>')) == np.eye(4)).all()
    with pytest.raises(ValueError, match='xyz="1 2" has not three numbers'):
        origin_of(ElementTree.fromstring('<visual><origin xyz="1 2"/></visual>'))


def test_a_joint_without_a_child_is_named():
    text = arm_urdf().replace('<child link="roll_link"/>', '')
    with pytest.raises(ValueError, match="not a URDF: joint 'roll' has no <child>"):
        read_joints(text)
