"""Conditions that must hold before a PR2 looks for something or takes it, for an oracle's settings.

Each takes a machine's userdata, which it does not read. They use head camera and encoders, with the
names of topics and services relative to the script's node. Where its parameter ~snapshot names no
service, or `none`, the next image of a real camera counts.
"""

import functools
from typing import Any, NamedTuple

import rospy

from smach_oracle.ros.parameters import name_of

from .fingers import may_hold
from .perception.blind import dazzled
from .robot import BASE_FRAME, CAMERA_FRAME, RobotError
from .ros_senses import RosSenses
from .ros_time import WorldTime

SNAPSHOT, PASS_TIME = 'world/snapshot', 'world/pass_time'
NONE = 'none'
COMES_S = 10.0  # wall s that an image may take
LIGHT_MOVES_S = 20.0  # s of the world's time that a light is waited for
AGAIN_S = 2.0  # from one look to the next


class _Eyes(NamedTuple):
    """The head camera, and the time of its world."""

    senses: RosSenses
    time: WorldTime
    simulated: bool


def no_light_in_the_camera(userdata: Any) -> bool:
    """Whether the camera is not dazzled. No image is no reason to think so."""
    eyes = _eyes()
    try:
        return not dazzled(eyes.senses.see(BASE_FRAME, CAMERA_FRAME))
    except RobotError as err:
        rospy.logwarn('pr2: whether light falls into the camera is not known: %s', err)
        return True


def wait_for_light(userdata: Any) -> bool:
    """Wait until the camera is no longer dazzled, for a while.

    :returns: always true: a light that stays may be no matter where the head looks from elsewhere.
    """
    eyes = _eyes()
    for _ in range(int(LIGHT_MOVES_S / AGAIN_S)):
        if rospy.is_shutdown() or no_light_in_the_camera(userdata):
            break
        if eyes.simulated:
            eyes.time.spend(AGAIN_S, 'waiting')
        else:
            rospy.sleep(AGAIN_S)
    return True


def right_hand_may_hold(userdata: Any) -> bool:
    """Whether something may be in the right hand, as after a pick that was stopped.

    No encoder readings are no reason to think so.
    """
    try:
        return may_hold(_eyes().senses.joints(), 'right')
    except RobotError as err:
        rospy.logwarn('pr2: whether the right hand holds something is not known: %s', err)
        return False


@functools.lru_cache(maxsize=1)
def _eyes() -> _Eyes:
    """Listen to the camera from the first question on."""
    snapshot = name_of('~snapshot', SNAPSHOT)
    simulated = snapshot != NONE
    pass_time = name_of('~pass_time', PASS_TIME)
    return _Eyes(
        RosSenses(snapshot if simulated else '', COMES_S),
        WorldTime(pass_time if simulated and pass_time != NONE else ''),
        simulated,
    )
