"""The world's own log of causes: when each began, and when it ended."""

import numpy as np
import pytest
from worlds import scene

from smach_oracle.pr2.robot import ARM_JOINTS
from smach_oracle.simulation.physics.passing import pass_time
from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.rehearsal.direct_robot import DirectRobot
from smach_oracle.simulation.scenes.scene import (
    LOCALISATION,
    Disturbance,
    RobotStart,
    SceneCause,
)

PAN = 'l_shoulder_pan_joint'


@pytest.fixture(scope='module')
def world():
    one = World()
    yield one
    one.close()


def spans(world):
    return {each.kind: each for each in world.cause_spans()}


def test_light_is_logged_from_its_event_until_it_ends(world):
    dim = Disturbance('dim', 'see', (('duration', 10.0),), 'shadow')
    world.reset(scene(disturbances=(dim,), causes=(SceneCause('shadow', 'somebody'),)))
    assert spans(world)['shadow'][3:] == (None, None)
    pass_time(world, 120)
    DirectRobot(world).see()
    pass_time(world, 300)
    assert spans(world)['shadow'][3:] == (pytest.approx(2.0, abs=0.1), None)
    pass_time(world, 600)
    shadow = spans(world)['shadow']
    assert shadow.ended_s - shadow.began_s == pytest.approx(10.0, abs=0.02)
    assert [shadow.there_at(second) for second in (1.0, 5.0, 13.0)] == [False, True, False]


def test_what_stands_in_the_way_is_there_from_the_start_until_it_is_moved(world):
    nudge = Disturbance('nudge:can', 'see', (('dx', 0.06),), 'object_moved')
    world.reset(
        scene(
            disturbances=(nudge,),
            causes=(
                SceneCause('crowded', 'close', ('can', 'carton'), True),
                SceneCause('slippery', 'wet'),
                SceneCause('object_moved', 'somebody'),
            ),
        )
    )
    pass_time(world, 600)
    assert spans(world)['crowded'][2:] == (True, 0.0, None)
    DirectRobot(world).see()
    pass_time(world, 600)
    found = spans(world)
    assert found['crowded'].ended_s == pytest.approx(10.5, abs=0.7)
    assert found['object_moved'].ended_s == pytest.approx(
        found['object_moved'].began_s + 0.4, abs=0.05
    )
    assert found['slippery'][3:] == (0.0, None)


def test_a_wrong_localisation_is_there_until_the_robot_is_told_where_it_stands(world):
    world.reset(
        scene(
            robot=RobotStart(localisation_error=(0.08, 0.0, 0.0)),
            causes=(SceneCause('base_misplaced', 'pushed', (LOCALISATION,), True),),
        )
    )
    pass_time(world, 600)
    assert spans(world)['base_misplaced'][3:] == (0.0, None)
    world.localise(world.true_base())
    pass_time(world, 6)
    assert spans(world)['base_misplaced'].ended_s == pytest.approx(10.1, abs=0.05)


def test_an_arm_that_was_pushed_is_in_the_way_until_it_is_moved(world):
    push = Disturbance('arm', 'see', ((PAN, 0.9),), 'arm_in_view')
    world.reset(
        scene(
            disturbances=(push,), causes=(SceneCause('arm_in_view', 'in the way', ('arm:' + PAN,)),)
        )
    )
    robot = DirectRobot(world)
    robot.see()
    pass_time(world, 600)
    began = spans(world)['arm_in_view']
    assert began.began_s is not None and began.ended_s is None
    robot.follow(ARM_JOINTS['left'][:1], np.array([[1.6]]), np.array([3.0]))
    assert spans(world)['arm_in_view'].ended_s > began.began_s + 9.0
