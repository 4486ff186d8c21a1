"""Commands for the interface that runs for a question: mark, choose an image, hand over, give up.

The interface is found by the action that the question names, and must be one of the closed set.
"""

import base64
from typing import Any, Callable, Dict, List, Mapping

import numpy as np
from geometry_msgs.msg import Point32, Polygon
from sensor_msgs.msg import PointCloud2

from smach_oracle.msg import ExpertQueryGoal, SegmentStroke
from smach_oracle.ros.images import colour_of
from smach_oracle.ros.service_calls import call_service
from smach_oracle.srv import (
    FinishInterface,
    FinishInterfaceRequest,
    GiveUpInterface,
    GiveUpInterfaceRequest,
    SegmentObject,
    SegmentObjectRequest,
    SegmentObjectResponse,
    UseFrame,
    UseFrameRequest,
)

from ...followed_server import ListedQuestion
from ..commands.commands import CommandReply, PageCommand
from ..commands.marking import FRESH
from ..sensors.clouds import Cloud, CloudError, encode_points, thinned
from ..sensors.images import cv2
from ..shapes.sensors import MarkedCloudView, MarkedView
from ..web.audit import Person
from .interface_actions import action_of
from .question_commands import CommandWorker, items

IMAGE_LIMIT_S = 15.0
NOT_RUNNING = 'No interface runs for this question any more.'
_MOST_CORNERS = 6000  # of a mask's outline
_MOST_POINTS = 4000  # of an object
Arguments = Dict[str, Any]  # of a command, checked
# the action, the arguments, the person and the question
InterfaceCommand = Callable[[str, Arguments, Person, ExpertQueryGoal], CommandReply]


class InterfaceCommands:
    """Carries out commands for the interfaces that run for questions."""

    def __init__(
        self, known: Callable[[str], bool], call: Callable[..., Any] = call_service
    ) -> None:
        """Make no ROS calls until a command comes.

        :param known: whether there is a SharedAutonomy action of that name.
        :param call: calls a service, as call_service does.
        """
        self._known = known
        self._call = call
        self._carry_out: Dict[str, InterfaceCommand] = {
            'mark': self._mark,
            'use_frame': self._use_frame,
            'hand_over': self._hand_over,
            'give_up_interface': self._give_up_interface,
        }

    @property
    def commands(self) -> Mapping[str, CommandWorker]:
        """Return the commands by name, for QuestionCommands."""
        return dict.fromkeys(self._carry_out, self.carry_out)

    def carry_out(
        self, command: PageCommand, person: Person, listed: ListedQuestion
    ) -> CommandReply:
        """Do one of them.

        :raises ServerGoneError: where the interface does not answer.
        """
        action = action_of(listed)
        if not action or not self._known(action):
            return CommandReply(False, NOT_RUNNING)
        return self._carry_out[command.name](action, command.arguments, person, listed.goal)

    def _mark(self, action: str, arguments: Arguments, *_: object) -> CommandReply:
        request = SegmentObjectRequest(
            stamp=arguments['stamp'],
            polygon=Polygon(_corners(arguments['region'])),
            strokes=[
                SegmentStroke(stroke.foreground, _corners(stroke.points), stroke.width)
                for stroke in arguments['strokes']
            ],
        )
        answer = self._call(action + '/segment', SegmentObject, request)
        return CommandReply(answer.ok, answer.message, marked_view(answer))

    def _use_frame(self, action: str, arguments: Arguments, *_: object) -> CommandReply:
        which = UseFrameRequest.FRESH if arguments['frame'] == FRESH else UseFrameRequest.AT_GOAL
        answer = self._call(action + '/use_frame', UseFrame, UseFrameRequest(which), IMAGE_LIMIT_S)
        return CommandReply(answer.ok, answer.message)

    def _hand_over(
        self, action: str, arguments: Arguments, person: Person, goal: ExpertQueryGoal
    ) -> CommandReply:
        request = FinishInterfaceRequest(
            arguments['outcome'],
            items(arguments['outputs'], goal),
            _record(person, arguments['why']),
            goal.query_id,
        )
        answer = self._call(action + '/finish', FinishInterface, request)
        return CommandReply(answer.ok, answer.message)

    def _give_up_interface(
        self, action: str, arguments: Arguments, person: Person, goal: ExpertQueryGoal
    ) -> CommandReply:
        request = GiveUpInterfaceRequest(_record(person, arguments['why']), goal.query_id)
        answer = self._call(action + '/give_up', GiveUpInterface, request)
        return CommandReply(answer.ok, answer.message)


def marked_view(answer: SegmentObjectResponse) -> MarkedView:
    """A segmentation for the page: outlines of the mask (px), place and size of the object."""
    data: MarkedView = {
        'outlines': outlines(colour_of(answer.mask)[:, :, 0]) if answer.mask.data else [],
        'elapsed': round(float(answer.elapsed), 3),
    }
    if answer.ok:
        place, turn = answer.object.pose.position, answer.object.pose.orientation
        data['object'] = {
            'frame': answer.object.header.frame_id[:200],
            'position': (_finite(place.x), _finite(place.y), _finite(place.z)),
            'yaw': _finite(2 * np.arctan2(turn.z, turn.w)),
            'points': answer.cloud.width,
            'size': (_finite(answer.size.x), _finite(answer.size.y), _finite(answer.size.z)),
            'cloud': _points(answer.cloud),
        }
    return data


def _points(message: PointCloud2) -> MarkedCloudView:
    """An object's cloud as the page gets clouds, its bytes in base64.

    Without points where the cloud cannot be shown.
    """
    try:
        cloud = thinned(message, _MOST_POINTS)
    except CloudError:
        cloud = Cloud(np.zeros((0, 3)), np.zeros((0, 3), np.uint8))
    encoded = encode_points(cloud, message.width * message.height)
    facts, data = encoded.facts, base64.b64encode(encoded.body).decode()
    return {
        'kind': 'cloud',
        'count': facts['count'],
        'of': facts['of'],
        'offset': facts['offset'],
        'scale': facts['scale'],
        'data': data,
    }


def outlines(mask: np.ndarray) -> List[List[int]]:
    """Outlines of a mask (h, w) uint8 where it is not 0, those of holes among them.

    :returns: closed lines x, y, x, y, ... in px. None where OpenCV is missing.
    """
    if cv2 is None:
        return []
    found, _ = cv2.findContours(np.ascontiguousarray(mask), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)
    lines: List[List[int]] = []
    for line in sorted(found, key=len, reverse=True):
        if sum(map(len, lines)) // 2 + len(line) <= _MOST_CORNERS:
            lines.append([int(each) for each in line.ravel()])
    return lines


def _corners(points: List[Any]) -> List[Point32]:
    return [Point32(x, y, 0.0) for x, y in points]


def _finite(value: float) -> float:
    return round(float(value), 4) if np.isfinite(value) else 0.0


def _record(person: Person, why: str) -> str:
    return '{}: {}'.format(person.expert, why) if why else 'by ' + person.expert
