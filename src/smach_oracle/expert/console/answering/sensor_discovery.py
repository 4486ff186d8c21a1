"""Keeps the closed sets of sensors and of perception interfaces up to date."""

from functools import partial
from types import MappingProxyType
from typing import Mapping, Optional, Sequence, Set

import rosservice

from smach_oracle.ros.master_watch import timed_master
from smach_oracle.srv import SegmentObject

from ...front_end import FrontEnd
from ...repeating import repeat
from ..sensors.depth_clouds import AS_A_CLOUD, DepthCloudStream, depth_cameras
from ..sensors.depth_clouds import TYPE as DEPTH_TYPE
from ..sensors.robot_cameras import PARAMETER, RobotCameras, declared_in
from ..sensors.robot_stream import DESCRIPTION, RobotStream, robots_in
from ..sensors.sensor_streams import DerivedStream, SensorStreams
from ..shapes.basics import ByKey
from ..shapes.sensors import PerceptionSensorsView, SensorListView
from ..web.sections import PageSections
from .interface_actions import action_of, interface_actions

DISCOVERY_PERIOD_S = 1.0
UPDATE_PERIOD_S = 0.1
_SEGMENT = '/segment'


class SensorDiscovery:
    """Its threads ask the master, and subscribe to the sensors that somebody watches."""

    def __init__(
        self,
        sections: PageSections,
        front_end: FrontEnd,
        cameras: Mapping[str, Sequence[str]] = MappingProxyType({}),
    ) -> None:
        """`cameras`: of robots, as set."""
        self.sensors = SensorStreams()
        self.cameras = RobotCameras(self.sensors, cameras)
        self._sections = sections
        self._front_end = front_end
        self._perception_actions: Set[str] = set()

    def is_perception(self, action: str) -> bool:
        """Whether a SharedAutonomy action belongs to a perception interface."""
        return action in self._perception_actions

    def start(self) -> None:
        """Begin. The threads end with the node."""
        repeat(self.discover, DISCOVERY_PERIOD_S)
        repeat(self._update, UPDATE_PERIOD_S)

    def discover(self) -> None:
        """Ask the master once."""
        master = timed_master()
        published = master.getPublishedTopics('')
        parameters = master.getParamNames()
        self.sensors.follow(
            published,
            [
                DerivedStream(
                    camera.depth + AS_A_CLOUD, DEPTH_TYPE, partial(DepthCloudStream, camera=camera)
                )
                for camera in depth_cameras(published)
            ]
            + [
                DerivedStream(name, DESCRIPTION, partial(RobotStream, parameter=name))
                for name in robots_in(parameters)
            ],
        )
        self.cameras.declare(
            {robot: master.getParam(robot + PARAMETER) for robot in declared_in(parameters)}
        )
        self._follow_interfaces(published, {name for name, _ in master.getSystemState()[2]})

    def write_sections(self) -> None:
        """Bring the section up to date."""
        view: SensorListView = {'sensors': self.sensors.view(), 'perception': self._running()}
        self._sections.put('sensors', view)

    def _update(self) -> None:
        self.sensors.update_subscriptions()
        self.write_sections()

    def _running(self) -> ByKey[PerceptionSensorsView]:
        """The questions for which a perception interface runs, each with two of its sensors.

        Those of the image and of its cloud, or None before there is one.
        """
        running: ByKey[PerceptionSensorsView] = {}
        for listed in self._front_end.questions():
            action = action_of(listed)
            if action and self.is_perception(action):
                running[listed.key] = {
                    'image': self._number_on(action + '/image'),
                    'cloud': self._number_on(action + '/cloud'),
                }
        return running

    def _number_on(self, topic: str) -> Optional[int]:
        sensor = self.sensors.on(topic)
        return sensor.number if sensor else None

    def _follow_interfaces(self, published: Sequence[Sequence[str]], services: Set[str]) -> None:
        there = {action for action in interface_actions(published) if action + _SEGMENT in services}
        known = self._perception_actions & there
        self._perception_actions = known | {
            action for action in there - known if _is_segmentation(action + _SEGMENT)
        }


def _is_segmentation(service: str) -> bool:
    try:
        return bool(rosservice.get_service_type(service) == SegmentObject._type)
    except (rosservice.ROSServiceException, OSError):
        return False
