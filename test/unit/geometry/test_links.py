"""Where links are, held against the chain's own kinematics."""

import numpy as np
import pytest
from test_chain import SEED, arm_urdf

from smach_oracle.geometry.chain import JointChain
from smach_oracle.geometry.joints import read_joints
from smach_oracle.geometry.links import joints_between, link_pose


def test_a_link_is_where_the_chain_says():
    chain = JointChain.from_urdf(arm_urdf(), 'base', 'tool_link')
    q = np.concatenate([[0.1], SEED])
    joints = dict(zip(chain.names, q))
    tree = read_joints(arm_urdf())
    assert link_pose(tree, 'base', 'tool_link', joints) == pytest.approx(
        chain.forward(q), abs=1e-12
    )
    assert (link_pose(tree, 'base', 'base', joints) == np.eye(4)).all()
    part = link_pose(tree, 'base', 'elbow_link', joints) @ link_pose(
        tree, 'elbow_link', 'tool_link', joints
    )
    assert part == pytest.approx(chain.forward(q), abs=1e-12)


def test_a_link_that_is_not_below_is_named():
    with pytest.raises(ValueError, match="'moon' does not hang below 'base'"):
        link_pose(read_joints(arm_urdf()), 'base', 'moon', {})


def test_links_that_go_round_in_a_circle_are_refused():
    circle = ''.join(
        '<joint name="{0}{1}" type="fixed"><parent link="{0}"/><child link="{1}"/></joint>'.format(
            *pair
        )
        for pair in ('ab', 'ba')
    )
    with pytest.raises(ValueError, match="'a' does not hang below 'base'"):
        link_pose(read_joints('<robot>{}</robot>'.format(circle)), 'base', 'a', {})


def test_a_joint_goes_with_the_one_that_it_mimics_unless_its_own_position_is_known():
    urdf = arm_urdf().replace(
        '<child link="elbow_link"/>',
        '<child link="elbow_link"/><mimic joint="pan" multiplier="-2" offset="0.5"/>',
    )
    tree = read_joints(urdf)
    for joints, elbow in (({'pan': 0.3}, -0.1), ({}, 0.5), ({'pan': 0.3, 'elbow': 0.2}, 0.2)):
        expected = link_pose(
            read_joints(arm_urdf()), 'base', 'tool_link', dict(joints, elbow=elbow)
        )
        assert link_pose(tree, 'base', 'tool_link', joints) == pytest.approx(expected, abs=1e-12)


def test_the_joints_that_move_a_link_are_named():
    tree = read_joints(arm_urdf())
    assert joints_between(tree, 'base', 'tool_link') == [
        'lift',
        'pan',
        'shoulder',
        'roll',
        'elbow',
        'forearm',
        'wrist',
        'hand',
    ], 'not the fixed one'
    assert joints_between(tree, 'roll_link', 'elbow_link') == ['elbow']
    assert joints_between(tree, 'base', 'base') == []
