"""Clients of the two interfaces' services."""

import time
from typing import Callable, Sequence, TypeVar

import numpy as np
import rospy
from geometry_msgs.msg import Point32
from sensor_msgs.msg import RegionOfInterest

from smach_oracle.msg import SegmentStroke
from smach_oracle.srv import (
    FinishInterface,
    GiveUpInterface,
    SegmentObject,
    SegmentObjectRequest,
    UseFrame,
    UseFrameRequest,
    UseFrameResponse,
)

from .showing import MarkedResult, OperatorStroke, Region
from .topic_hand import GoalEndedError

_RETRY_S = 0.05
T = TypeVar('T')


class FinishClient:
    """Ends the goal of an interface, as a person does."""

    def __init__(self, interface: str) -> None:
        self._finish = rospy.ServiceProxy(interface + '/finish', FinishInterface)
        self._give_up = rospy.ServiceProxy(interface + '/give_up', GiveUpInterface)

    def finish(self, outcome: str, text: str) -> str:
        """Supersede the state. Return why not, or ''."""
        answer = self._finish(outcome=outcome, text=text)
        return '' if answer.ok else answer.message

    def give_up(self, text: str) -> None:
        """End it without a result. It does nothing where it has ended already."""
        self._give_up(text=text)


class PerceptionClient:
    """The perception interface."""

    def __init__(self, interface: str) -> None:
        self._segment = rospy.ServiceProxy(interface + '/segment', SegmentObject)
        self._use_frame = rospy.ServiceProxy(interface + '/use_frame', UseFrame)

    def take_image(self, limit_s: float) -> rospy.Time:
        """Have a fresh image shown, waiting at most so long (wall time) for the interface to begin.

        :returns: its stamp.
        :raises GoalEndedError: where it does not, or gets no image.
        """

        def use_fresh() -> UseFrameResponse:
            return self._use_frame(UseFrameRequest.FRESH)

        def shows(response: UseFrameResponse) -> bool:
            return bool(response.ok)

        answer = until(use_fresh, shows, limit_s)
        if not answer.ok:
            raise GoalEndedError('the perception interface shows nothing: ' + answer.message)
        return answer.stamp

    def segment(self, region: Region, strokes: Sequence[OperatorStroke]) -> MarkedResult:
        """See showing.SegmentCall."""
        request = SegmentObjectRequest(
            region=RegionOfInterest(
                x_offset=region[0], y_offset=region[1], width=region[2], height=region[3]
            )
        )
        request.strokes = [
            SegmentStroke(line.foreground, [Point32(x, y, 0.0) for x, y in line.points], 0.0)
            for line in strokes
        ]
        answer = self._segment(request)
        mask = answer.mask
        shown = np.frombuffer(mask.data, np.uint8).reshape(mask.height, mask.width) > 0
        return MarkedResult(answer.ok, answer.message, shown if shown.size else None)


def until(call: Callable[[], T], holds: Callable[[T], bool], limit_s: float) -> T:
    """Call until the answer holds, at most so long in wall time, and return the last answer."""
    until_s = time.monotonic() + limit_s
    answer = call()
    while not holds(answer) and time.monotonic() < until_s and not rospy.is_shutdown():
        time.sleep(_RETRY_S)
        answer = call()
    return answer
