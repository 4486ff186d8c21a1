"""The node of the PR2's perception: objects on the table, a drink in the open refrigerator."""

import contextlib
from typing import Dict, Iterator, List, Optional

import numpy as np
import rospy
from geometry_msgs.msg import Point, PointStamped
from rosgraph.names import is_legal_name
from std_msgs.msg import ColorRGBA, Header

from smach_oracle.geometry.camera_image import CameraImage
from smach_oracle.geometry.joints import Joint, read_joints
from smach_oracle.geometry.transforms import apply
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
from smach_oracle.oracle.settings.written import plain
from smach_oracle.ros.command_line import parameters_only
from smach_oracle.ros.parameters import name_of
from smach_oracle.ros.reading.yaml_files import read_yaml

from ..kitchen import Kitchen, base_from_fridge, kitchen_from, shelf_point
from ..perception.clusters import HERE, Capsule, NotSeen
from ..perception.colours import name_of as name_of_colour
from ..perception.drink import find_drink
from ..perception.own_limbs import limbs_of
from ..perception.tabletop import (
    Look,
    Tabletop,
    distance_from,
    find_tabletop,
    things_on_table,
)
from ..planning.arm import SkillError
from ..robot import ODOM_FRAME, Robot
from ..ros_robot import NO_PASS_TIME, NO_SNAPSHOT, RosRobot
from ..work_costs import Work
from .frames import box_messages, point_in_base
from .skill_server import PartResultError, ReportStatus, SkillServer

HIGHEST_LEAST = 0.3  # m: what is asked for as `min_height`
# m in the fridge's frame, beside the point that the robot looks at by default
VIEWS = ((0.0, 0.0, 0.0), (0.0, -0.22, 0.0), (0.0, 0.22, 0.0), (0.0, 0.0, 0.22))
MODEL_WAIT_S = 60.0
DETECTION = Work(detections=1)
NEARER = 0.02  # m by which one thing must stand nearer than another to count as nearer


class Perception:
    """The results of the two actions, from what the camera sees. Needs no node."""

    def __init__(self, robot: Robot, links: Dict[str, Joint], kitchen: Kitchen) -> None:
        """
        :param links: the robot's joints by the link that each carries, from `joints.read_joints`.
        :param kitchen: the map in which the refrigerator is.
        """
        self._robot = robot
        self._links = links
        self._kitchen = kitchen

    def detect_tabletop(
        self, goal: DetectTabletopGoal, report: ReportStatus
    ) -> DetectTabletopResult:
        """The table and the objects on it.

        :raises NotSeen: where they cannot be made out.
        :raises RobotError: where no image comes.
        """
        lowest = _height(goal.min_height)
        report('looking')
        image = self._robot.see()
        limbs = self._limbs()
        self._robot.spend('perception', DETECTION)
        like, near = _look(goal), self._near(goal.nearest_to)
        with told_where_to_look(image, self._robot.odom_from_base()):
            found = find_tabletop(image, lowest, limbs, like, near)
            if like is None:
                self._look_beside(image, found, near)
        report('{} objects'.format(len(found.objects)))
        objects = [box_messages(box, _stamp(image)) for box in found.objects]
        return DetectTabletopResult(
            table=box_messages(found.table, _stamp(image))[0],
            objects=[pose for pose, _ in objects],
            sizes=[size for _, size in objects],
            colours=[_message_of(each) for each in found.colours],
        )

    def detect_drink(self, goal: DetectDrinkGoal, report: ReportStatus) -> DetectDrinkResult:
        """The foremost drink on the shelf, or the foremost one of the colour asked for.

        :raises NotSeen: where none can be made out.
        :raises RobotError: where the head does not move, or no image comes.
        """
        lowest = _height(goal.min_height)
        fridge = base_from_fridge(self._kitchen, self._robot.odom_from_base())
        report('looking into the refrigerator')
        aside = VIEWS[goal.view % len(VIEWS)]
        self._robot.look_at(apply(fridge, shelf_point(self._kitchen) + aside))
        image = self._robot.see()
        limbs = self._limbs()
        self._robot.spend('perception', DETECTION)
        pose, size = box_messages(
            find_drink(image, self._kitchen, fridge, lowest, limbs, goal.colour), _stamp(image)
        )
        return DetectDrinkResult(drink=pose, size=size)

    def _near(self, point: PointStamped) -> np.ndarray:
        """(2,) m or more in the frame of the base, from which "nearest" counts.

        :raises NotSeen: for a point that is not allowed.
        """
        if not point.header.frame_id:
            return HERE
        try:
            return point_in_base(point, self._robot, 'nearest_to')
        except SkillError as err:
            raise NotSeen(str(err)) from err

    def _look_beside(self, image: CameraImage, found: Tabletop, near: np.ndarray) -> None:
        """Glance at parts of the table that the image cuts off, then look where it showed.

        :param near: (2,) m or more, from which "nearest" counts.

        :raises NotSeen: where something stands there that is nearer than the first object.
        """
        first = found.objects[0].centre
        for point in found.beyond:
            self._robot.look_at(point)
            glance, limbs = self._robot.see(), self._limbs()
            self._robot.spend('perception', DETECTION)
            for box in things_on_table(glance, limbs):
                if distance_from(near, box.centre) < distance_from(near, first) - NEARER:
                    raise NotSeen(
                        'something nearer stands beside what the image showed', box.centre
                    )
        if found.beyond:
            ahead = np.linalg.norm(first - image.base_from_camera[:3, 3])
            self._robot.look_at(apply(image.base_from_camera, np.array([0.0, 0.0, ahead])))

    def _limbs(self) -> List[Capsule]:
        return limbs_of(self._links, self._robot.joints())


def _look(goal: DetectTabletopGoal) -> Optional[Look]:
    """Return the looks of the object that a goal asks for, or None for the nearest one.

    :raises NotSeen: for numbers that are not allowed.
    """
    if goal.colour.a == 0:
        return None
    colour = (goal.colour.r, goal.colour.g, goal.colour.b)
    size = (goal.size.x, goal.size.y, goal.size.z)
    if not all(is_number(each, 0, 1) for each in colour + size):
        raise NotSeen('colour is {}, size {} m; allowed: 0 to 1'.format(colour, size))
    return Look(255.0 * np.array(colour), np.array(size))


@contextlib.contextmanager
def told_where_to_look(image: CameraImage, odom_from_base: np.ndarray) -> Iterator[None]:
    """Have the action's result say where to look to see more, where a failure knows it.

    It says so in odom_combined: the robot may have driven when it looks there.
    """
    try:
        yield
    except NotSeen as err:
        if err.where is None:
            raise
        header = Header(frame_id=ODOM_FRAME, stamp=_stamp(image))
        where = Point(*apply(odom_from_base, err.where))
        raise PartResultError(str(err), {'look_at': PointStamped(header, where)}) from err


def _message_of(colour: np.ndarray) -> ColorRGBA:
    """A colour (3,), 0 to 255, as a message, with a 0 where it is too dark to tell."""
    return ColorRGBA(*(colour / 255.0), 1.0 if name_of_colour(colour) else 0.0)


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
    return _service('~snapshot', 'world/snapshot')


def pass_time_service() -> str:
    """The service that the parameter ~pass_time names, or `none`, as where ~snapshot is.

    :raises SettingsError: for what cannot be a service's name.
    """
    simulated = snapshot_service() != NO_SNAPSHOT
    return _service('~pass_time', 'world/pass_time' if simulated else NO_PASS_TIME)


def _service(parameter: str, default: str) -> str:
    name = name_of(parameter, default)
    if not is_legal_name(name):
        raise SettingsError(rospy.resolve_name(parameter), name, 'the name of a service, or none')
    return name


def kitchen_at(parameter: str) -> Kitchen:
    """The map that a parameter names as a file, or gives as a dictionary.

    :returns: the usual map where the parameter is `none`.
    :raises ValueError: for what is not a map. The error names the parameter.
    """
    value: object = rospy.get_param(parameter, 'none')
    if value in ('none', ''):
        return Kitchen()
    try:
        return kitchen_from(_read(path_of(value)) if isinstance(value, str) else value)
    except Exception as err:  # a value that is not what its tag says can make PyYAML raise anything
        raise ValueError('{}: {}'.format(rospy.resolve_name(parameter), err)) from err


def _read(path: str) -> object:
    return plain(read_yaml(path, 'the map of the kitchen')[0])


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
        raise ValueError(
            'no parameter {} within {:.0f} s'.format(
                rospy.resolve_name('robot_description'), limit_s
            )
        )
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
        'Parameters: ~snapshot, ~pass_time, ~kitchen; see doc/perception.md.'
    )
    rospy.init_node('pr2_perception')
    try:
        snapshot, pass_time = snapshot_service(), pass_time_service()
        kitchen = kitchen_at('~kitchen')
        links = robot_links()
    except ValueError as err:
        rospy.logfatal('pr2_perception: %s', err)
        raise SystemExit(2) from err
    robot = RosRobot(snapshot=snapshot, pass_time=pass_time)
    await_robot(robot)
    perception, server = Perception(robot, links, kitchen), SkillServer(robot.abort, robot.resume)
    server.offer('detect_tabletop', DetectTabletopAction, perception.detect_tabletop, (NotSeen,))
    server.offer('detect_drink', DetectDrinkAction, perception.detect_drink, (NotSeen,))
    rospy.loginfo('pr2_perception: %d actions ready', server.names())
    rospy.spin()
