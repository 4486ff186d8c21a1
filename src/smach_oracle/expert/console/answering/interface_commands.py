"""Carries out what people do through a perception interface that runs for a question: mark, choose a frame, hand over,
give up. The interface is found by the action that the question names, and must be one of the closed set."""
import base64
from typing import Any, Callable, Dict, List, Mapping

import cv2
import numpy as np
import rosgraph.names
from geometry_msgs.msg import Point32, Polygon
from sensor_msgs.msg import PointCloud2

from smach_oracle.msg import ExpertQueryGoal, SegmentStroke
from smach_oracle.srv import (FinishInterface, FinishInterfaceRequest, GiveUpInterface, GiveUpInterfaceRequest,
                              SegmentObject, SegmentObjectRequest, SegmentObjectResponse, UseFrame, UseFrameRequest)

from ...ros.images import colour_of
from ..followed_server import Listed, call_service
from .audit import Person
from .clouds import Cloud, CloudError, encode_points, thinned
from .commands import Command
from .desk import Reply, Worker, items
from .eye_commands import FRESH

FRAME_LIMIT_S = 15.0
NOT_RUNNING = 'No interface runs for this question any more.'
_MOST_CORNERS = 6000  # of a mask's outline
_MOST_POINTS = 4000  # of an object


def action_of(listed: Listed) -> str:
    """The resolved name of the action that now runs for a question; '' where none does."""
    offer = next((each for each in listed.goal.interfaces if each.name == listed.goal.interface), None)
    if not listed.goal.interface or offer is None:
        return ''
    return rosgraph.names.resolve_name(offer.action, listed.goal.robot)


class PerceptionDesk:
    """Works on questions for which a perception interface runs."""

    def __init__(self, known: Callable[[str], bool], call: Callable[..., Any] = call_service) -> None:
        """`known`: whether there is a SharedAutonomy action of that name. `call`: as call_service."""
        self._known = known
        self._call = call

    @property
    def commands(self) -> Mapping[str, Worker]:
        """For the desk."""
        return {name: self.carry_out for name in ('mark', 'use_frame', 'hand_over', 'give_up_interface')}

    def carry_out(self, command: Command, person: Person, listed: Listed) -> Reply:
        """Do one of them. Raises ServerGoneError where the interface does not answer."""
        action = action_of(listed)
        if not action or not self._known(action):
            return Reply(False, NOT_RUNNING)
        work = getattr(self, '_' + command.name)
        return work(action, command.arguments, person, listed.goal)  # type: ignore[no-any-return]

    def _mark(self, action: str, said: Dict[str, Any], *_: Any) -> Reply:
        request = SegmentObjectRequest(stamp=said['stamp'], polygon=Polygon(_corners(said['region'])), strokes=[
            SegmentStroke(stroke.foreground, _corners(stroke.points), stroke.width) for stroke in said['strokes']])
        answer = self._call(action + '/segment', SegmentObject, request)
        return Reply(answer.ok, answer.message, marked_view(answer))

    def _use_frame(self, action: str, said: Dict[str, Any], *_: Any) -> Reply:
        which = UseFrameRequest.FRESH if said['frame'] == FRESH else UseFrameRequest.AT_GOAL
        answer = self._call(action + '/use_frame', UseFrame, UseFrameRequest(which), FRAME_LIMIT_S)
        return Reply(answer.ok, answer.message)

    def _hand_over(self, action: str, said: Dict[str, Any], person: Person, goal: ExpertQueryGoal) -> Reply:
        request = FinishInterfaceRequest(said['outcome'], items(said['outputs'], goal), _record(person, said['why']),
                                         goal.query_id)
        answer = self._call(action + '/finish', FinishInterface, request)
        return Reply(answer.ok, answer.message)

    def _give_up_interface(self, action: str, said: Dict[str, Any], person: Person, goal: ExpertQueryGoal) -> Reply:
        request = GiveUpInterfaceRequest(_record(person, said['why']), goal.query_id)
        answer = self._call(action + '/give_up', GiveUpInterface, request)
        return Reply(answer.ok, answer.message)


def marked_view(answer: SegmentObjectResponse) -> Dict[str, Any]:
    """What was made out, for the page: outlines of the mask in px of the frame; where the object is, and how large."""
    data: Dict[str, Any] = {'outlines': outlines(colour_of(answer.mask)[:, :, 0]) if answer.mask.data else [],
                            'elapsed': round(float(answer.elapsed), 3)}
    if answer.ok:
        place, turn = answer.object.pose.position, answer.object.pose.orientation
        data['object'] = {'frame': answer.object.header.frame_id[:200], 'position': _finite(place.x, place.y, place.z),
                          'yaw': _finite(2 * np.arctan2(turn.z, turn.w))[0], 'points': answer.cloud.width,
                          'size': _finite(answer.size.x, answer.size.y, answer.size.z),
                          'cloud': _points(answer.cloud)}
    return data


def _points(message: PointCloud2) -> Dict[str, Any]:
    """As a frame of a cloud has it, its bytes in base64; without points where the cloud cannot be shown."""
    try:
        cloud = thinned(message, _MOST_POINTS)
    except CloudError:
        cloud = Cloud(np.zeros((0, 3)), np.zeros((0, 3), np.uint8))
    encoded = encode_points(cloud, message.width * message.height)
    return dict(encoded.facts, data=base64.b64encode(encoded.body).decode())


def outlines(mask: np.ndarray) -> List[List[int]]:
    """Closed lines x, y, x, y, ... (px) around what is not 0 in a mask (h, w) uint8, and around the holes in it."""
    found, _ = cv2.findContours(np.ascontiguousarray(mask), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)
    lines: List[List[int]] = []
    for line in sorted(found, key=len, reverse=True):
        if sum(map(len, lines)) // 2 + len(line) <= _MOST_CORNERS:
            lines.append([int(each) for each in line.ravel()])
    return lines


def _corners(points: List[Any]) -> List[Point32]:
    return [Point32(x, y, 0.0) for x, y in points]


def _finite(*values: float) -> List[float]:
    return [round(float(value), 4) if np.isfinite(value) else 0.0 for value in values]


def _record(person: Person, why: str) -> str:
    return '{}: {}'.format(person.expert, why) if why else 'by ' + person.expert
