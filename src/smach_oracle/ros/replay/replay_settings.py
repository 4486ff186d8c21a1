"""Reads the private parameters about the last seconds before a failure."""

from typing import Dict, List, NamedTuple, Sequence, Tuple

import rospy
from sensor_msgs.msg import CompressedImage, Image

from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.settings import checks

from ..parameters import checked_number, private_names, read_or_default

CAMERAS = '~failure_cameras'
MOST_CAMERAS = 4
CAMERA_TYPES: Dict[str, type] = {Image._type: Image, CompressedImage._type: CompressedImage}
MEGABYTE = 10**6
USUAL_JOINTS = ['joint_states']  # where there are cameras
MOST_JOINT_TOPICS = 4
_MOST_MB = 1e6


class ReplaySettings(NamedTuple):
    """The settings of one node. Topics have their resolved names."""

    cameras: Tuple[str, ...] = ()
    joints: Tuple[str, ...] = ()
    seconds: float = 30.0  # ROS time
    most_bytes: int = 6 * MEGABYTE
    bag_bytes: int = 20 * MEGABYTE  # of one trial
    rate: float = 2.0  # images a second, of each camera
    width: int = 320  # px

    @property
    def on(self) -> bool:
        """Whether there is anything to keep."""
        return bool(self.seconds and self.most_bytes and (self.cameras or self.joints))


def camera_topics(topics: Sequence[str]) -> List[str]:
    """Return the resolved names of ~failure_cameras.

    :raises SettingsError: where they are no names of topics, or more than four.
    """
    return _resolved(CAMERAS, topics, MOST_CAMERAS)


def read_settings() -> ReplaySettings:
    """Read the parameters.

    :raises SettingsError: naming the parameter whose value is invalid.
    """
    cameras = camera_topics(private_names(CAMERAS[1:]))
    joints = read_or_default('~replay_joints', USUAL_JOINTS if cameras else [])
    names = checks.words('parameter ' + rospy.resolve_name('~replay_joints'), joints)
    usual = ReplaySettings()
    return ReplaySettings(
        tuple(cameras),
        tuple(_resolved('~replay_joints', names, MOST_JOINT_TOPICS)),
        _number('~replay_s', usual.seconds, 0, 600),
        round(MEGABYTE * _number('~replay_mb', usual.most_bytes / MEGABYTE, 0, _MOST_MB)),
        round(MEGABYTE * _number('~replay_bag_mb', usual.bag_bytes / MEGABYTE, 0, _MOST_MB)),
        _number('~replay_rate', usual.rate, 0.01, 10),
        round(_number('~replay_width', usual.width, 16, 1280)),
    )


def _number(name: str, usual: float, low: float, high: float) -> float:
    return checked_number(name, read_or_default(name, usual), low, high)


def _resolved(name: str, topics: Sequence[str], most: int) -> List[str]:
    key = 'parameter ' + rospy.resolve_name(name)
    if len(checks.words(key, topics)) > most:
        raise SettingsError(key, topics, 'at most {} names of topics'.format(most))
    return [rospy.resolve_name(topic) for topic in topics]
