"""Borders of the PR2's skills and perception: goals with fields of any value."""

import functools
from typing import Any, Callable, Dict
from unittest import mock

import actionlib
import genpy
import numpy as np
from arms import REST
from geometry_msgs.msg import Point, PointStamped, Pose, PoseStamped, Quaternion, Vector3
from hypothesis import strategies as st
from std_msgs.msg import ColorRGBA, Header

from smach_oracle.geometry.joints import read_joints
from smach_oracle.msg import (
    BuildCollisionMapGoal,
    CloseDoorGoal,
    DetectDrinkAction,
    DetectDrinkGoal,
    DetectTabletopAction,
    DetectTabletopGoal,
    HandOverGoal,
    LocaliseAtFridgeGoal,
    MoveArmsAsideGoal,
    OpenDoorGoal,
    PickGoal,
    PlaceGoal,
    PointHeadGoal,
)
from smach_oracle.pr2.kitchen import Kitchen
from smach_oracle.pr2.nodes.kitchen_skills import KitchenSkills
from smach_oracle.pr2.nodes.manipulation_node import serve
from smach_oracle.pr2.nodes.perception_node import Perception
from smach_oracle.pr2.nodes.skill_server import SkillServer
from smach_oracle.pr2.perception.clusters import NotSeen
from smach_oracle.pr2.planning.arm import SkillContext
from smach_oracle.pr2.planning.collision import installed_model
from smach_oracle.pr2.robot import RobotError

from .border import BOTH, REFUSED, TAKEN, Border, refused
from .fake_ros import as_bytes, fake_ros
from .small_image import small_image
from .values import message, sent, words

STILL = 'this robot stands still'


class StillRobot:
    """A fake robot: it looks, and believes to stand somewhere, and refuses everything else."""

    def __init__(self, sees: bool) -> None:
        self._sees = sees

    def joints(self) -> Dict[str, float]:
        if not self._sees:
            raise RobotError('joint_states: ' + STILL)
        return {
            **dict.fromkeys((joint.name for joint in _links().values() if joint.moves), 0.0),
            **REST,
        }

    def odom_from_base(self) -> np.ndarray:
        return np.eye(4)

    def look_at(self, point: Any) -> None:
        assert np.isfinite(point).all()

    def see(self) -> Any:
        if not self._sees:
            raise RobotError('camera: ' + STILL)
        return small_image().image

    def spend(self, what: str, work: Any) -> None:
        pass

    def __getattr__(self, name: str) -> Callable[..., None]:
        def refuse(*_: object, **__: object) -> None:
            raise RobotError('{}: {}'.format(name, STILL))

        return refuse


class FakeSimpleServer:
    """A fake SimpleActionServer, whose goals are handed to it."""

    def __init__(self, name: str, spec: type, execute: Any, auto_start: bool) -> None:
        self.execute, self.end = execute, ('', '')

    def register_preempt_callback(self, callback: Any) -> None:
        pass

    def start(self) -> None:
        pass

    def is_preempt_requested(self) -> bool:
        return False

    def publish_feedback(self, feedback: genpy.Message) -> None:
        as_bytes(feedback)

    def _ended(self, end: str, result: genpy.Message, text: str) -> None:
        as_bytes(result)
        self.end = end, text

    def set_succeeded(self, result: genpy.Message, text: str = '') -> None:
        self._ended(TAKEN, result, text)

    def set_aborted(self, result: genpy.Message, text: str = '') -> None:
        self._ended(REFUSED, result, text)

    set_preempted = set_aborted


@functools.lru_cache(maxsize=None)
def _links() -> Any:
    return read_joints(installed_model().urdf)


@functools.lru_cache(maxsize=None)
def servers() -> Dict[str, FakeSimpleServer]:
    """Of all skills and both detections, by the names of their actions."""
    made: Dict[str, FakeSimpleServer] = {}

    def server(name: str, spec: type, execute: Any, auto_start: bool) -> FakeSimpleServer:
        made[name] = FakeSimpleServer(name, spec, execute, auto_start)
        return made[name]

    with fake_ros(), mock.patch.object(actionlib, 'SimpleActionServer', server):
        skills = SkillServer(lambda: None, lambda: None)
        serve(KitchenSkills(SkillContext(StillRobot(False), installed_model()), Kitchen()), skills)
        perception = Perception(StillRobot(True), _links(), Kitchen())
        skills.offer(
            'detect_tabletop', DetectTabletopAction, perception.detect_tabletop, (NotSeen,)
        )
        skills.offer('detect_drink', DetectDrinkAction, perception.detect_drink, (NotSeen,))
    return made


def _action(name: str) -> Callable[[Any], str]:
    def take(goal: Any) -> str:
        server = servers()[name]
        with fake_ros():
            server.execute(goal)
        end, text = server.end
        assert not text.startswith('error in'), text
        return TAKEN if end == TAKEN else refused(text)

    return take


_header = message(
    Header, {'frame_id': words('base_footprint', 'base_link', 'odom_combined', '/base_footprint')}
)
_coordinates = st.floats(-1.0, 1.0)
_place = st.builds(Point, _coordinates, _coordinates, _coordinates)
_upright = st.just(Quaternion(0.0, 0.0, 0.0, 1.0))
_pose = message(PoseStamped, {'header': _header, 'pose': st.builds(Pose, _place, _upright)})
_size = message(Vector3, {name: st.floats(0.01, 0.2) for name in 'xyz'})
_arm = words('left', 'right')
_map = words('', 'fridge', 'map_00000000')
_MANY = 3000


_counts = st.one_of(*[st.integers(0, 3)] * 7, st.just(_MANY))


def a_mug_many_times(count: int) -> BuildCollisionMapGoal:
    """A goal with so many objects."""
    mug = PoseStamped(
        Header(frame_id='base_footprint'),
        Pose(Point(0.6, 0.0, 0.8), Quaternion(0.0, 0.0, 0.0, 1.0)),
    )
    return sent(
        BuildCollisionMapGoal(
            table=mug, objects=[mug] * count, sizes=[Vector3(0.06, 0.06, 0.1)] * count
        )
    )


_maps = st.one_of(
    message(
        BuildCollisionMapGoal,
        {
            'table': _pose,
            'objects': st.lists(_pose, max_size=2),
            'sizes': st.lists(_size, max_size=2),
        },
    ),
    _counts.map(a_mug_many_times),
)
_colour = message(ColorRGBA, {name: st.floats(0, 1, width=32) for name in 'rgba'})
BORDERS = [
    Border(
        'action move_arms_aside',
        message(
            MoveArmsAsideGoal,
            {
                'arms': st.one_of(
                    st.lists(_arm, max_size=2), _counts.map(lambda count: ['left'] * count)
                )
            },
        ),
        _action('move_arms_aside'),
        (REFUSED,),
    ),
    Border(
        'action point_head',
        message(
            PointHeadGoal, {'target': message(PointStamped, {'header': _header, 'point': _place})}
        ),
        _action('point_head'),
    ),
    Border('action build_collision_map', _maps, _action('build_collision_map')),
    Border(
        'action pick',
        message(PickGoal, {'arm': _arm, 'object': _pose, 'size': _size, 'map_id': _map}),
        _action('pick'),
        (REFUSED,),
    ),
    Border(
        'action place',
        message(
            PlaceGoal,
            {
                'arm': _arm,
                'pose': _pose,
                'grasp': _pose,
                'map_id': _map,
                'tolerance': st.floats(0.0, 0.1),
            },
        ),
        _action('place'),
        (REFUSED,),
    ),
    Border(
        'action localise_at_fridge',
        message(LocaliseAtFridgeGoal),
        _action('localise_at_fridge'),
        (REFUSED,),
    ),
    Border(
        'action open_door', message(OpenDoorGoal, {'arm': _arm}), _action('open_door'), (REFUSED,)
    ),
    Border(
        'action close_door',
        message(CloseDoorGoal, {'arm': _arm}),
        _action('close_door'),
        (REFUSED,),
    ),
    Border(
        'action hand_over',
        message(HandOverGoal, {'arm': _arm, 'pose': _pose}),
        _action('hand_over'),
        (REFUSED,),
    ),
    Border(
        'action detect_tabletop',
        message(
            DetectTabletopGoal,
            {'min_height': st.floats(0.0, 0.3), 'colour': _colour, 'size': _size},
        ),
        _action('detect_tabletop'),
        BOTH,
    ),
    Border(
        'action detect_drink',
        message(
            DetectDrinkGoal, {'min_height': st.floats(0.0, 0.3), 'colour': words('', 'red', 'grey')}
        ),
        _action('detect_drink'),
        (REFUSED,),
    ),
]
