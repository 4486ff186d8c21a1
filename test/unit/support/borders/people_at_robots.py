"""Borders of the interfaces that people use: marks on an image, and commands to a hand."""

import functools
import math
import warnings
from types import SimpleNamespace
from typing import Any, Callable, Tuple
from unittest import mock

import numpy as np
import rospy
from geometry_msgs.msg import Point32, Polygon, Twist, Vector3
from hypothesis import strategies as st
from sensor_msgs.msg import JointState, RegionOfInterest
from std_msgs.msg import Header

from smach_oracle.interfaces.manipulation import arm_port
from smach_oracle.interfaces.manipulation.arm_port import ArmNames, JointListener
from smach_oracle.interfaces.manipulation.cartesian_drive import DriveLimits, no_motion
from smach_oracle.interfaces.manipulation.dead_man_switch import DeadManSwitch
from smach_oracle.interfaces.manipulation.server import TeleoperationServer
from smach_oracle.interfaces.manipulation.settings import NO_SNAPSHOT, TeleoperationSettings
from smach_oracle.interfaces.manipulation.teleoperated_arm import DescribedRobot, TeleoperatedArm
from smach_oracle.interfaces.perception import server as perception_server
from smach_oracle.interfaces.perception.image_source import TakenImage
from smach_oracle.interfaces.perception.server import SegmentationServer
from smach_oracle.msg import SegmentStroke, SharedAutonomyGoal, TeleopCommand
from smach_oracle.pr2.model.pr2_model import pr2_urdf
from smach_oracle.pr2.robot import ARM_JOINTS, BASE_FRAME, TOOL_FRAME
from smach_oracle.ros.images import colour_image
from smach_oracle.srv import SegmentObjectRequest, UseFrameRequest

from .border import TAKEN, Border, refused
from .fake_ros import FakeHandle, Offered, as_bytes, fake_ros
from .small_image import small_image
from .values import message, words

GOAL = SharedAutonomyGoal(
    query_id='q1', state='DETECT', outcomes=['succeeded', 'aborted'], output_keys=['object']
)
MOST_POINTS = 40  # in place of the server's, so that more are drawn quickly


# -- marks on an image


@functools.lru_cache(maxsize=None)
def _marking() -> Tuple[Offered, SegmentationServer]:
    """A perception interface with a goal, whose camera gives the same image, and its services."""
    taken = TakenImage(
        colour_image(small_image().image.colour, Header(stamp=rospy.Time(7), frame_id='camera')),
        small_image().image,
    )
    with fake_ros() as offered:
        made = SegmentationServer(
            {'DETECT': {'outputs': {'object': 'object'}}},
            SimpleNamespace(take=lambda: taken, base_frame=BASE_FRAME),
        )
        offered.actions[0].on_goal(FakeHandle(GOAL))
        assert made._marking is not None
        made._marking._taken.wait()
    return offered, made


def _mark(service: str) -> Callable[[Any], str]:
    def take(request: Any) -> str:
        offered, _ = _marking()
        with fake_ros(), mock.patch.object(
            perception_server, 'MOST_POINTS', MOST_POINTS
        ), warnings.catch_warnings():
            warnings.simplefilter('error', RuntimeWarning)  # a NaN went past
            reply = offered.call(service, request)
        return TAKEN if reply.ok else refused(reply.message)

    return take


def _around(jitter: Tuple[int, int]) -> RegionOfInterest:
    left, top, width, height = small_image().region
    return RegionOfInterest(
        x_offset=left - jitter[0],
        y_offset=top - jitter[1],
        width=width + 2 * jitter[0],
        height=height + 2 * jitter[1],
    )


_jitters = st.tuples(st.integers(0, 4), st.integers(0, 4))
_pixel = message(
    Point32,
    {
        'x': st.one_of(*[st.floats(0, 220, width=32)] * 9, st.sampled_from((math.nan, math.inf))),
        'y': st.floats(0, 160, width=32),
    },
)
_stroke = message(
    SegmentStroke, {'width': st.floats(0, 9, width=32), 'points': st.lists(_pixel, max_size=3)}
)
_very_long = st.just([SegmentStroke(points=[Point32()] * (MOST_POINTS + 1))])
_marks = message(
    SegmentObjectRequest,
    {
        'stamp': st.sampled_from((rospy.Time(0), rospy.Time(7))),
        'region': _jitters.map(_around),
        'polygon': st.one_of(
            *[st.just(Polygon())] * 4,
            message(Polygon, {'points': st.lists(_pixel, min_size=2, max_size=4)}),
            st.just(Polygon(points=[Point32()] * (MOST_POINTS + 1))),
        ),
        'strokes': st.one_of(st.just([]), st.just([]), st.lists(_stroke, max_size=2), _very_long),
    },
)


# -- a hand


class FakeGripperLink:
    """A fake gripper that never comes to the end of a motion."""

    name = '/gripper'

    def __init__(self, *_: object) -> None:
        pass

    def ready(self) -> bool:
        return True

    alive = ready

    def send(self, goal: Any) -> Any:
        as_bytes(goal)
        return SimpleNamespace(
            cancel=lambda: None, poll=lambda timeout_s: None, unheard=lambda now_s: False
        )


def _arm(robot: DescribedRobot, side: str) -> TeleoperatedArm:
    return TeleoperatedArm(
        robot,
        ArmNames('torso_lift_link', TOOL_FRAME[side], side + '/command', side + '/gripper'),
        DriveLimits(),
        0.1,
    )


@functools.lru_cache(maxsize=None)
def _hand() -> Any:
    """The server of two arms with a goal, whose thread does not run."""
    settings = TeleoperationSettings(
        arms={},
        base=BASE_FRAME,
        limits=DriveLimits(),
        states={},
        arm_keys=[],
        success=['succeeded'],
        rate_hz=50.0,
        watchdog_s=60.0,
        lease_s=60.0,
        lead=0.1,
        gripper_effort=10.0,
        lock_step=False,
        snapshot=NO_SNAPSHOT,
        clearance=False,
    )
    with fake_ros() as offered, mock.patch.object(
        arm_port, 'GoalLink', FakeGripperLink
    ), mock.patch.object(TeleoperationServer, '_run', lambda self: None):
        robot = DescribedRobot(pr2_urdf().read_text(), BASE_FRAME, JointListener())
        made: Any = TeleoperationServer(
            settings, {side: _arm(robot, side) for side in ('left', 'right')}
        )
        offered.actions[0].on_goal(FakeHandle(GOAL))
        assert made._goal.goal is not None
    made._goal.drop_if_asker_is_gone = lambda: None
    return made, offered


def _joints() -> JointState:
    names = (
        ['torso_lift_joint']
        + [name for side in ('left', 'right') for name in ARM_JOINTS[side]]
        + ['head_pan_joint', 'head_tilt_joint']
    )
    return JointState(
        Header(stamp=rospy.Time(7)),
        names,
        [
            -0.5 if name.endswith(('flex_joint', 'lift_joint')) and name[1] == '_' else 0.1
            for name in names
        ],
        [],
        [],
    )


def _take_wish(command: TeleopCommand) -> str:
    made, offered = _hand()
    with fake_ros(), warnings.catch_warnings():
        warnings.simplefilter('error', RuntimeWarning)
        offered.topics['joint_states'](_joints())
        made._dead_man, made._held, made._step = DeadManSwitch(60.0), None, no_motion()
        offered.topics['~command'](command)
        made._work(0.0)
        why = made._refused
        if made._held is not None:
            made._work(0.0)  # a period of motion
            assert not made._refused
        assert np.isfinite(made._step.velocities).all()
        made._stop_moving()
    return refused(why) if why else TAKEN


_speeds = message(Vector3, {name: st.floats(-0.3, 0.3) for name in 'xyz'})
_wishes = message(
    TeleopCommand,
    {
        'header': message(
            Header, {'frame_id': words(BASE_FRAME, TOOL_FRAME['left'], 'wide_stereo_optical_frame')}
        ),
        'operator': words('eva'),
        'arm': words('left', 'right'),
        'dead_man': st.just(True),
        'twist': message(Twist, {'linear': _speeds, 'angular': _speeds}),
        'gripper': st.floats(0.0, 0.09),
        'gripper_effort': st.floats(0.0, 50.0),
    },
)

BORDERS = [
    Border('service segment', _marks, _mark('~segment')),
    Border(
        'service use_frame',
        message(UseFrameRequest, {'frame': st.sampled_from((0, 1))}),
        _mark('~use_frame'),
    ),
    Border('topic TeleopCommand', _wishes, _take_wish),
]
