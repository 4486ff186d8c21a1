"""The node of the PR2's perception: objects on the table, a drink in the open refrigerator."""
from typing import Dict, List, Optional

import rospy
import yaml
from rosgraph.names import is_legal_name

from smach_oracle.geometry.camera_image import CameraImage
from smach_oracle.geometry.joints import Joint, read_joints
from smach_oracle.msg import (
    DetectDrinkAction,
    DetectDrinkGoal,
    DetectDrinkResult,
    DetectTabletopAction,
    DetectTabletopGoal,
    DetectTabletopResult,
)
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.number_checks import is_number
from smach_oracle.oracle.settings.paths import path_of
from smach_oracle.ros.command_line import parameters_only
from smach_oracle.ros.parameters import name_of

from ..kitchen import Kitchen, base_from_fridge, kitchen_from, look_point
from ..perception.clusters import Capsule, NotSeen
from ..perception.drink import find_drink
from ..perception.own_limbs import limbs_of
from ..perception.tabletop import find_tabletop
from ..robot import Robot
from ..ros_robot import RosRobot
from .frames import box_messages
from .skill_server import ReportStatus, SkillServer

HIGHEST_LEAST = 0.3  # m: what is asked for as `min_height`
MODEL_WAIT_S = 60.0


class Perception:
    """What the camera sees, as the results of the two actions. Needs no node."""

    def __init__(self, robot: Robot, links: Dict[str, Joint], kitchen: Kitchen) -> None:
        """
        :param links: the robot's joints by the link that each carries, from `joints.read_joints`.
        :param kitchen: the map in which the refrigerator is.
        """
        self._robot = robot
        self._links = links
        self._kitchen = kitchen

    def detect_tabletop(self, goal: DetectTabletopGoal,
                        report: ReportStatus) -> DetectTabletopResult:
        """The table and the objects on it.

        :raises NotSeen: where they cannot be made out.
        :raises RobotError: where no image comes.
        """
        lowest = _height(goal.min_height)
        report('looking')
        image = self._robot.see()
        found = find_tabletop(image, lowest, self._limbs())
        report('{} objects'.format(len(found.objects)))
        objects = [box_messages(box, _stamp(image)) for box in found.objects]
        return DetectTabletopResult(table=box_messages(found.table, _stamp(image))[0],
                                    objects=[pose for pose, _ in objects],
                                    sizes=[size for _, size in objects])

    def detect_drink(self, goal: DetectDrinkGoal, report: ReportStatus) -> DetectDrinkResult:
        """The foremost drink on the shelf.

        :raises NotSeen: where none can be made out.
        :raises RobotError: where the head does not move, or no image comes.
        """
        lowest = _height(goal.min_height)
        fridge = base_from_fridge(self._kitchen, self._robot.odom_from_base())
        report('looking into the refrigerator')
        self._robot.look_at(look_point(self._kitchen, fridge))
        image = self._robot.see()
        pose, size = box_messages(find_drink(image, self._kitchen, fridge, lowest, self._limbs()),
                                  _stamp(image))
        return DetectDrinkResult(drink=pose, size=size)

    def _limbs(self) -> List[Capsule]:
        return limbs_of(self._links, self._robot.joints())


def _height(value: float) -> float:
    """A goal's `min_height`, m.

    :raises NotSeen: for one that is not allowed.
    """
    if not is_number(value, 0, HIGHEST_LEAST):
        raise NotSeen('min_height is {} m; allowed: 0 to {}'.format(value, HIGHEST_LEAST))
    return float(value)


def _stamp(image: CameraImage) -> rospy.Time:
    return rospy.Time.from_sec(image.stamp)


def snapshot_service() -> str:
    """The service that the parameter ~snapshot names, or `none`.

    :raises SettingsError: for what cannot be a service's name.
    """
    name = name_of('~snapshot', 'world/snapshot')
    if not is_legal_name(name):
        raise SettingsError(rospy.resolve_name('~snapshot'), name, 'the name of a service, or none')
    return name


def kitchen_at(parameter: str) -> Kitchen:
    """The map that a parameter names as a file, or gives as a dictionary.

    :returns: the usual map where the parameter is `none`.
    :raises ValueError: for what is not a map; names the parameter.
    """
    value: object = rospy.get_param(parameter, 'none')
    if value in ('none', ''):
        return Kitchen()
    try:
        return kitchen_from(_read(path_of(value)) if isinstance(value, str) else value)
    except Exception as err:  # a value that is not what its tag says can make PyYAML raise anything
        raise ValueError('{}: {}'.format(rospy.resolve_name(parameter), err)) from err


def _read(path: str) -> object:
    with open(path, encoding='utf-8') as file:
        return yaml.safe_load(file)


def robot_links(limit_s: float = MODEL_WAIT_S) -> Dict[str, Joint]:
    """The robot's joints from `robot_description`, which may come only after this node.

    :raises ValueError: where it does not come within the limit.
    """
    period_s = 0.1
    text: Optional[str] = rospy.get_param('robot_description', None)
    for _ in range(int(limit_s / period_s)):
        if text is not None or rospy.is_shutdown():
            break
        rospy.rostime.wallsleep(period_s)
        text = rospy.get_param('robot_description', None)
    if text is None:
        raise ValueError('no parameter {} within {:.0f} s'.format(
            rospy.resolve_name('robot_description'), limit_s))
    return read_joints(text)


def await_robot(robot: RosRobot) -> None:
    """Wait until a simulated robot is connected, so that nothing of the first goal gets lost."""
    lacking = robot.wait_until_connected()
    if lacking and not rospy.is_shutdown():
        rospy.logwarn('%s: not connected yet: %s', rospy.get_name(), ', '.join(lacking))


def main() -> None:
    """Entry point of the node."""
    parameters_only(
        'Node: detects the table and the objects on it, and drinks in the refrigerator. '
        'Parameters: ~snapshot, ~kitchen; see doc/perception.md.')
    rospy.init_node('pr2_perception')
    try:
        snapshot, kitchen = snapshot_service(), kitchen_at('~kitchen')
        links = robot_links()
    except ValueError as err:
        rospy.logfatal('pr2_perception: %s', err)
        raise SystemExit(2) from err
    robot = RosRobot(snapshot=snapshot)
    await_robot(robot)
    perception, server = Perception(robot, links, kitchen), SkillServer(robot.abort, robot.resume)
    server.offer('detect_tabletop', DetectTabletopAction, perception.detect_tabletop, (NotSeen,))
    server.offer('detect_drink', DetectDrinkAction, perception.detect_drink, (NotSeen,))
    rospy.loginfo('pr2_perception: %d actions ready', server.names())
    rospy.spin()
