"""PLACE on the simulated PR2 where its object ends as it should not: the outcome and its text."""

import math

import pybullet
import pytest
from forked import in_own_fork
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, Vector3
from std_msgs.msg import Header
from worlds import CAN, CARTON, TABLE, scene

from smach_oracle.msg import BuildCollisionMapGoal, PickGoal, PlaceGoal
from smach_oracle.pr2.nodes import manipulation
from smach_oracle.pr2.nodes.manipulation import Manipulation
from smach_oracle.pr2.planning.arm import Arm, SkillContext, SkillError
from smach_oracle.pr2.planning.collision import installed_model
from smach_oracle.pr2.skills.place import ObjectLost
from smach_oracle.simulation.physics.judge import UPRIGHT
from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.rehearsal.direct_robot import DirectRobot

PLACE = (0.6, -0.35, 0.79)
STAND_IN = CAN._replace(name='stand-in', position=(1.05, 0.55, 0.78), colour=(0.1, 0.2, 0.8))
# it leans from 17 degrees on, and falls back to where it stands from less
SLIM = CAN._replace(size=(0.024, 0.024, 0.16), position=(0.70, -0.20, 0.80))
POST = CAN._replace(
    name='post', shape='box', size=(0.05, 0.05, 0.22), position=(0.6, -0.46, 0.83), mass=0.0
)


def say(status):
    """Nobody listens."""


def pose(x, y, z):
    return PoseStamped(
        Header(frame_id='base_footprint'), Pose(Point(x, y, z), Quaternion(0.0, 0.0, 0.0, 1.0))
    )


class Bench:
    """A world in which a hand holds the can, and the goal that puts it down."""

    def __init__(self, *more, can=CAN):
        self.world = World(scene(TABLE, can, CARTON, *more), binning=2)
        self.robot = DirectRobot(self.world)
        self.skills = Manipulation(SkillContext(self.robot, installed_model()))
        table = pose(0.85, 0.0, 0.72)
        table.pose.orientation = Quaternion(0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))
        bodies = [can, CARTON, *more]
        made = self.skills.build_collision_map(
            BuildCollisionMapGoal(
                table, [pose(*body.position) for body in bodies], [size_of(body) for body in bodies]
            ),
            say,
        )
        self.robot.look_at(can.position)
        held = self.skills.pick(
            PickGoal(
                arm='right', object=pose(*can.position), size=size_of(can), map_id=made.map_id
            ),
            say,
        )
        self.goal = PlaceGoal(
            arm='right', pose=pose(*PLACE), grasp=held.grasp, map_id=made.map_id, tolerance=0.0
        )

    def place(self):
        self.skills.place(self.goal, say)

    def move(self, name, position, roll=0.0):
        """Take a thing elsewhere, and let it come to rest."""
        pybullet.resetBasePositionAndOrientation(
            self.world._find(name).number,
            position,
            pybullet.getQuaternionFromEuler([roll, 0.0, 0.0]),
            physicsClientId=self.world.client,
        )
        pybullet.resetBaseVelocity(
            self.world._find(name).number, (0, 0, 0), (0, 0, 0), physicsClientId=self.world.client
        )
        self.world.step(60)

    def upright(self):
        return self.world.body_pose('can')[2, 2] >= UPRIGHT


def size_of(body):
    wide = body.size if body.shape == 'box' else (2 * body.size[0], 2 * body.size[1], body.size[2])
    return Vector3(*wide)


@pytest.fixture(name='bench', scope='module')
def _bench():
    bench = Bench()
    yield bench
    bench.world.close()


@pytest.fixture(name='bench_with_post', scope='module')
def _bench_with_post():
    bench = Bench(POST, can=SLIM)
    yield bench
    bench.world.close()


@pytest.fixture(name='after_release')
def _after_release(monkeypatch):
    """What happens to the object when the hand has let go of it, before the robot looks."""
    happens, really = [], manipulation.arms_aside

    def arms_aside(*given):
        really(*given)
        while happens:
            happens.pop()()

    monkeypatch.setattr(manipulation, 'arms_aside', arms_aside)
    return happens.append


@in_own_fork
def test_what_stands_when_the_hand_has_let_go_is_placed(bench):
    bench.place()
    assert bench.upright()


@pytest.mark.parametrize('degrees', [20, 25])
@in_own_fork
def test_what_leans_against_another_thing_is_told_to_lean(bench_with_post, after_release, degrees):
    """Judged by the angle in the world, too."""
    bench = bench_with_post
    lean = math.radians(degrees)
    # its upper edge touches the post, its lower edge stands on the table
    edge = POST.position[1] + POST.size[1] / 2
    there = (
        PLACE[0],
        edge + SLIM.size[0] * math.cos(lean) + SLIM.size[2] / 2 * math.sin(lean),
        0.72 + SLIM.size[2] / 2 * math.cos(lean) + SLIM.size[0] * math.sin(lean),
    )
    after_release(lambda: bench.move('can', there, lean))
    with pytest.raises(
        SkillError, match='let go, but it leans (by [12][0-9] degrees )?at its place'
    ):
        bench.place()
    assert not bench.upright()


@in_own_fork
def test_what_lies_is_told_to_lie(bench, after_release):
    after_release(lambda: bench.move('can', (PLACE[0], PLACE[1], 0.752), math.pi / 2))
    with pytest.raises(SkillError, match='let go, but it lies at its place: .* 6 cm high'):
        bench.place()
    assert not bench.upright()


@in_own_fork
def test_what_has_rolled_away_is_told_to_be_gone(bench, after_release):
    after_release(lambda: bench.move('can', (PLACE[0] + 0.25, PLACE[1], 0.752), math.pi / 2))
    with pytest.raises(SkillError, match='let go, but nothing stands at its place'):
        bench.place()


def test_another_thing_than_was_meant_is_told_by_its_colour_also_to_a_second_try(after_release):
    """The second try finds the hand empty, and the other thing in place."""
    bench = Bench(STAND_IN)

    def swap():
        bench.move('can', (1.05, -0.55, 0.78))
        bench.move('stand-in', (PLACE[0], PLACE[1], 0.78))

    after_release(swap)
    told = 'another thing is at its place: that is blue, and the object is red'
    with pytest.raises(SkillError, match='let go, but ' + told):
        bench.place()
    with pytest.raises(ObjectLost, match='the right hand holds nothing, and ' + told):
        bench.place()
    bench.world.close()


@pytest.mark.parametrize(
    'turn, where, fallen',
    [
        (0, 'on the way to its place', (1.05, -0.55, 0.78)),
        (0, 'on the way to its place', (PLACE[0], PLACE[1], 0.78)),
        (1, 'while it was lowered', (1.05, -0.55, 0.78)),
    ],
)
@in_own_fork
def test_a_hand_that_loses_its_object_says_so_wherever_it_falls(
    bench, monkeypatch, turn, where, fallen
):
    """Also to a second try, and where the object fell upside down upon its place."""
    follow, motions = Arm.follow, []

    def lose(arm, *given):
        follow(arm, *given)
        motions.append(given)
        if len(motions) == 1 + turn:
            bench.move('can', fallen, math.pi)

    monkeypatch.setattr(Arm, 'follow', lose)
    with pytest.raises(ObjectLost, match='the object was lost ' + where):
        bench.place()
    with pytest.raises(ObjectLost, match='the right hand holds nothing: it has lost its object'):
        bench.place()
    assert not bench.upright()
