"""The operator's eye: the robot's images, and what people recognise in them."""

from typing import List, NamedTuple, Sequence, Tuple

import numpy as np
import rospy

from smach_oracle.interfaces.perception.image_source import ImageSource, ImageSourceError
from smach_oracle.msg import SeenThing as SeenThingMessage
from smach_oracle.ros.service_calls import ServerGoneError, call_service
from smach_oracle.srv import Recognise, RecogniseRequest, RecogniseResponse

from .seen_scene import ROBOT, Outline, SeenScene, SeenThing, seen_scene

_ANSWER_S = 30.0  # wall time


class ViewError(Exception):
    """Nothing can be seen at all: no image comes, or nobody recognises anything in images."""


class ViewerTopics(NamedTuple):
    """Names of what the eye goes by."""

    rgb: str = 'head_camera/rgb/image_raw'
    depth: str = 'head_camera/depth_registered/image_raw'
    camera_info: str = 'head_camera/rgb/camera_info'
    snapshot: str = 'world/snapshot'  # or 'none': the next image
    recognise: str = 'world/recognise'


class ImageViewer:
    """Looks at images as a person at a screen."""

    def __init__(self, topics: ViewerTopics, base: str) -> None:
        """`base`: the frame in which places are told."""
        self._source = ImageSource(
            topics.rgb, topics.depth, topics.camera_info, base, topics.snapshot
        )
        self._recognise = rospy.resolve_name(topics.recognise)
        self.chance = 0  # of the trial that was seen last, for what a person gets wrong

    def look(self, *names: str) -> SeenScene:
        """Return what a fresh image shows: all things, and furniture by these names.

        :raises ViewError: where there is none.
        """
        try:
            taken = self._source.take()
        except ImageSourceError as err:
            raise ViewError(str(err)) from err
        size = taken.image.depth.shape[1], taken.image.depth.shape[0]
        found = self.outlines(taken.message.header.stamp, size)
        found += self.outlines(taken.message.header.stamp, size, (ROBOT, *names))
        return seen_scene(taken.image, found)

    def outlines(
        self, stamp: rospy.Time, size: Tuple[int, int], names: Sequence[str] = ()
    ) -> List[Outline]:
        """Return the outlines of what is recognised in a published image.

        :param size: its width and height, px.
        :param names: what is looked for. () means all things that a hand could take.
        :raises ViewError: where nobody answers, or the image is not known.
        """
        try:
            answer: RecogniseResponse = call_service(
                self._recognise, Recognise, RecogniseRequest(stamp, list(names)), _ANSWER_S
            )
        except ServerGoneError as err:
            raise ViewError(str(err)) from err
        self.chance = answer.chance
        if not answer.ok:
            raise ViewError(answer.message)
        return [
            Outline(thing.name, thing.wanted, thing.movable, _mask(thing, size))
            for thing in answer.things
        ]

    def wanted_at(self, stamp: rospy.Time, size: Tuple[int, int]) -> List[SeenThing]:
        """Return the outline of the task's object in a published image, [] where it is not seen.

        :raises ViewError: as `outlines`.
        """
        return [
            SeenThing(each.name, True, each.movable, _region(each.mask), each.mask, None)
            for each in self.outlines(stamp, size)
            if each.wanted
        ]


def _mask(thing: SeenThingMessage, size: Tuple[int, int]) -> np.ndarray:
    region = thing.region
    mask = np.zeros((size[1], size[0]), bool)
    part = np.frombuffer(thing.mask.data, np.uint8).reshape(region.height, region.width) > 0
    mask[
        region.y_offset : region.y_offset + region.height,
        region.x_offset : region.x_offset + region.width,
    ] = part
    return mask


def _region(mask: np.ndarray) -> Tuple[int, int, int, int]:
    rows, columns = np.nonzero(mask)
    return (int(columns.min()), int(rows.min()), int(np.ptp(columns)) + 1, int(np.ptp(rows)) + 1)
