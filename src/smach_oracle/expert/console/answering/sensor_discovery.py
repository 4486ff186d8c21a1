"""What the console sees with: the closed sets of sensors and of perception interfaces, kept up to date."""
import threading
import time
from functools import partial
from typing import Any, Dict, Sequence, Set

import rosgraph
import rospy
import rosservice

from smach_oracle.msg import SharedAutonomyActionResult
from smach_oracle.srv import SegmentObject

from ...oracle.errors import OracleError
from ..front_end import FrontEnd
from .depth_clouds import AS_A_CLOUD, TYPE as DEPTH_TYPE, DepthCloudSensor, depth_cameras
from .perception_desk import action_of
from .robot_sensor import DESCRIPTION, RobotSensor, robots_in
from .sections import Sections
from .sensors import Derived, Sensors

LOOK_PERIOD_S = 1.0
TEND_PERIOD_S = 0.1
_RESULT = '/result'
_SEGMENT = '/segment'


class Eye:
    """Its threads ask the master, and listen to what is looked at."""

    def __init__(self, sections: Sections, front_end: FrontEnd) -> None:
        self.sensors = Sensors()
        self._sections = sections
        self._front_end = front_end
        self._perceptions: Set[str] = set()

    def is_perception(self, action: str) -> bool:
        """Whether a SharedAutonomy action has a perception interface's service beside it."""
        return action in self._perceptions

    def start(self) -> None:
        """Begin; the threads end with the node."""
        for step, period_s in ((self.look, LOOK_PERIOD_S), (self._tend, TEND_PERIOD_S)):
            threading.Thread(target=_again, args=(step, period_s), name=step.__name__, daemon=True).start()

    def look(self) -> None:
        """Ask the master once."""
        master = rosgraph.Master(rospy.get_name())
        published = master.getPublishedTopics('')
        self.sensors.follow(published, [
            Derived(camera.depth + AS_A_CLOUD, DEPTH_TYPE, partial(DepthCloudSensor, camera=camera))
            for camera in depth_cameras(published)] + [
            Derived(name, DESCRIPTION, partial(RobotSensor, parameter=name))
            for name in robots_in(master.getParamNames())])
        self._follow_interfaces(published, {name for name, _ in master.getSystemState()[2]})

    def draw(self) -> None:
        """Bring the section up to date."""
        self._sections.put('eye', {'sensors': self.sensors.view(), 'perception': self._running()})

    def _tend(self) -> None:
        self.sensors.tend()
        self.draw()

    def _running(self) -> Dict[str, Any]:
        """By question for which a perception interface runs: the sensors of its frame and of the cloud of that, None
        before there is one."""
        running = {}
        for listed in self._front_end.questions():
            action = action_of(listed)
            if action and self.is_perception(action):
                running[listed.key] = {name: sensor.number if sensor else None for name, sensor in (
                    (name, self.sensors.on('{}/{}'.format(action, name))) for name in ('image', 'cloud'))}
        return running

    def _follow_interfaces(self, published: Sequence[Sequence[str]], services: Set[str]) -> None:
        actions = {topic[:-len(_RESULT)] for topic, kind in published
                   if kind == SharedAutonomyActionResult._type and topic.endswith(_RESULT)}
        there = {action for action in actions if action + _SEGMENT in services}
        known = self._perceptions & there
        self._perceptions = known | {action for action in there - known if _cuts_out(action + _SEGMENT)}


def _cuts_out(service: str) -> bool:
    try:
        return bool(rosservice.get_service_type(service) == SegmentObject._type)
    except (rosservice.ROSServiceException, OSError):
        return False


def _again(step: Any, period_s: float) -> None:
    while not rospy.is_shutdown():
        try:
            step()
        except (OSError, OracleError, rosgraph.MasterException, rospy.ROSException) as err:
            rospy.logdebug('The sensors could not be looked for: %s', err)
        time.sleep(period_s)
