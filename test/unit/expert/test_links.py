"""Where links are, held against the chain's own kinematics."""
import numpy as np
import pytest
from test_teleoperation import READY, urdf

from smach_oracle.geometry.chain import Chain, read_joints
from smach_oracle.geometry.links import joints_between, link_pose


def test_a_link_is_where_the_chain_says():
    chain = Chain.from_urdf(urdf(), 'base', 'tool')
    joints = dict(zip(chain.names, READY))
    tree = read_joints(urdf())
    assert link_pose(tree, 'base', 'tool', joints) == pytest.approx(chain.forward(READY), abs=1e-9)
    assert (link_pose(tree, 'base', 'base', joints) == np.eye(4)).all()
    part = link_pose(tree, 'base', 'l3', joints) @ link_pose(tree, 'l3', 'tool', joints)
    assert part == pytest.approx(chain.forward(READY), abs=1e-9)


def test_a_link_that_is_not_below_is_named():
    with pytest.raises(ValueError, match="'moon' is no link below 'base'"):
        link_pose(read_joints(urdf()), 'base', 'moon', {})


def test_the_joints_that_move_a_link_are_named():
    tree = read_joints(urdf())
    assert sorted(joints_between(tree, 'base', 'tool')) == ['j{}'.format(n) for n in range(7)], 'not the fixed one'
    assert joints_between(tree, 'l1', 'l2') == ['j2'] and joints_between(tree, 'base', 'base') == []
