"""The service for people's eyes: what can be recognised in an image that was published."""

from collections import OrderedDict
from typing import Tuple

import numpy as np
import rospy
from sensor_msgs.msg import RegionOfInterest
from std_msgs.msg import Header

from smach_oracle.msg import SeenThing
from smach_oracle.pr2.robot import CAMERA_FRAME
from smach_oracle.ros.images import mask_image
from smach_oracle.srv import RecogniseRequest, RecogniseResponse

from ..physics.recognition import SeenView, chance_of, recognised, view_of
from ..physics.world import World

KEPT = 8  # images


class Recognition:
    """Keeps the last images, and tells what a person sees in one. In the world's thread."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._views: 'OrderedDict[rospy.Time, SeenView]' = OrderedDict()

    def keep(self, stamp: rospy.Time, colour: np.ndarray) -> None:
        """An image (h, w, 3) uint8 that has just been taken is published with this stamp."""
        self._views[stamp] = view_of(self._world, colour)
        while len(self._views) > KEPT:
            self._views.popitem(last=False)

    def forget(self) -> None:
        """Another trial begins: its people have seen nothing yet."""
        self._views.clear()

    def answer(self, request: RecogniseRequest) -> RecogniseResponse:
        """See srv/Recognise.srv."""
        view = self._views.get(request.stamp)
        chance = chance_of(self._world.scene.seed)
        if view is None:
            return RecogniseResponse(
                ok=False,
                chance=chance,
                message='no image with the stamp {:.3f} is known'.format(request.stamp.to_sec()),
            )
        wanted = self._world.scene.goal.body
        found = recognised(view, request.names or self._world.movable())
        things = [
            self._message(name, mask, request.stamp)
            for name, mask in sorted(found.items(), key=lambda item: (item[0] != wanted, item[0]))
        ]
        return RecogniseResponse(True, '', chance, things)

    def _message(self, name: str, mask: np.ndarray, stamp: rospy.Time) -> SeenThing:
        (top, bottom), (left, right) = _span(np.any(mask, axis=1)), _span(np.any(mask, axis=0))
        region = RegionOfInterest(
            x_offset=left, y_offset=top, width=right - left, height=bottom - top
        )
        return SeenThing(
            name,
            name == self._world.scene.goal.body,
            name in self._world.movable(),
            region,
            mask_image(mask[top:bottom, left:right], Header(0, stamp, CAMERA_FRAME)),
        )


def _span(there: np.ndarray) -> Tuple[int, int]:
    """First and last index, the last excluded, of what is there."""
    indices = np.flatnonzero(there)
    return int(indices[0]), int(indices[-1]) + 1
