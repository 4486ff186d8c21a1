"""The cameras that are a robot's own.

The setting ~cameras says so, the robot's ~failure_cameras, or name and namespace.
A node directly below / owns no other node's cameras: nothing tells whose those are.
"""

import re
from typing import Dict, Iterable, List, Mapping, Sequence

import rosgraph.names

from ..shapes.sensors import SensorView
from ..web.sections import PageSections
from .sensor_streams import SensorStreams

SECTION = 'cameras'
PARAMETER = '/failure_cameras'  # behind the robot's name
MOST_DECLARED = 64
_NO_COLOUR = re.compile('depth|disparity|/ir/')
_RANK = [re.compile(pattern) for pattern in ('/(rgb|color|colour)/', 'image_(raw|rect|color)', '')]


class RobotCameras:
    """Asked by any thread. One thread declares, one writes sections."""

    def __init__(self, sensors: SensorStreams, chosen: Mapping[str, Sequence[str]]) -> None:
        """`chosen`: of a robot its topics, or names above topics, the setting."""
        self._sensors = sensors
        self._chosen = chosen
        self._declared: Dict[str, List[str]] = {}
        self._robots: List[str] = []
        self._own: Dict[str, List[str]] = {}

    def declare(self, declared: Mapping[str, object]) -> None:
        """Take in the values of ~failure_cameras, by robot."""
        self._declared = {
            robot: [_resolved(topic, robot) for topic in topics if isinstance(topic, str)]
            for robot, topics in declared.items()
            if isinstance(topics, list)
        }

    def of(self, robot: str) -> List[SensorView]:
        """Return a robot's own cameras in colour, the likeliest first.

        The list is empty where none is known.
        """
        images = [each for each in self._sensors.view() if each['kind'] == 'image']
        colour = [each for each in images if not _NO_COLOUR.search(each['topic'])]
        if robot in self._chosen:
            names = self._chosen[robot]
            return [each for each in images if each['topic'] in names] + _ranked(
                each
                for each in colour
                if each['topic'] not in names
                and any(_is_below(each['topic'], name) for name in names)
            )
        declared = self._declared.get(robot, [])
        first = [each for topic in declared for each in images if each['topic'] == topic]
        own = [each for each in colour if _is_below(each['topic'], robot)]
        return first + _ranked(
            each for each in own or self._around(robot, colour) if each['topic'] not in declared
        )

    def topics_of(self, robot: str) -> List[str]:
        """Return the topics of its own cameras, as written last."""
        return self._own.get(robot, [])

    def write_sections(self, sections: PageSections, robots: Iterable[str]) -> None:
        """Bring the section up to date, for these robots."""
        self._robots = sorted(robots)
        self._own = {robot: [each['topic'] for each in self.of(robot)] for robot in self._robots}
        sections.put(SECTION, self._own)

    def _around(self, robot: str, cameras: Sequence[SensorView]) -> List[SensorView]:
        """Return the cameras of a robot's namespace that lie below no other robot's name."""
        space = robot[: robot.rfind('/')]
        others = [other for other in self._robots if other != robot]
        return [
            each
            for each in cameras
            if space
            and _is_below(each['topic'], space)
            and not any(_is_below(each['topic'], other) for other in others)
        ]


def declared_in(names: Iterable[str]) -> List[str]:
    """Return the robots among whose parameters is a ~failure_cameras."""
    return [name[: -len(PARAMETER)] for name in names if name.endswith(PARAMETER)][:MOST_DECLARED]


def _ranked(cameras: Iterable[SensorView]) -> List[SensorView]:
    return sorted(
        cameras,
        key=lambda each: (
            next(rank for rank, pattern in enumerate(_RANK) if pattern.search(each['topic'])),
            each['topic'],
        ),
    )


def _is_below(topic: str, name: str) -> bool:
    return topic.startswith(name.rstrip('/') + '/')


def _resolved(topic: str, robot: str) -> str:
    if topic.startswith('~'):
        return '{}/{}'.format(robot, topic[1:].lstrip('/'))
    return str(rosgraph.names.resolve_name(topic, rosgraph.names.namespace(robot)))
