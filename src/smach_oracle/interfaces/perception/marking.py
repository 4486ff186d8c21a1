"""The images that an expert draws on while a goal is active, and the object cut out of one."""

import threading
from typing import Callable, Collection, Dict, List, Mapping, NamedTuple, Optional, Tuple, Union

import numpy as np
import rospy
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, Vector3
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from smach_oracle.geometry.box import UprightBox
from smach_oracle.geometry.transforms import quaternion
from smach_oracle.ros.images import cloud_message

from ..interface_goal import InterfaceGoalError
from .image_source import ImageSourceError, TakenImage
from .marked_scene import MarkedScene, MarkedSceneError, scene_of
from .output_templates import OF_THE_SCENE, StateTemplate
from .segmentation import SegmentationError, SegmentedObject, Stroke, segment

NO_MARK = (
    'no object is marked, so {} cannot be filled in: mark it (call segment) first, give them with '
    'the outcome, choose another outcome, or give up'
)

# a value of output userdata
OutputMessage = Union[PoseStamped, Vector3, PointCloud2, List[PoseStamped], List[Vector3]]


class ObjectInImage(NamedTuple):
    """An object in the image that it was marked in."""

    segmented: SegmentedObject
    header: Header  # stamp of that image, and the frame of the base
    scene: Optional[MarkedScene]
    why_no_scene: str


class ObjectMarking:
    """The marking for one goal. A thread of its own takes the first image, which may last."""

    def __init__(
        self,
        template: StateTemplate,
        take: Callable[[], TakenImage],
        base_frame: str,
        show: Callable[[TakenImage], None],
    ) -> None:
        """
        :param take: returns a fresh image, or raises ImageSourceError.
        :param show: publishes the image that is in use.
        """
        self.template = template
        self._take = take
        self._base_frame = base_frame
        self._show = show
        self._lock = threading.Lock()
        self._taken = threading.Event()
        self._over = False
        self._at_goal: Optional[TakenImage] = None
        self._in_use: Optional[TakenImage] = None
        self._why_no_image = 'the image of the goal has not come yet'
        self._marked: Optional[ObjectInImage] = None
        threading.Thread(target=self._take_first, name='image of the goal', daemon=True).start()

    def end(self) -> None:
        """The goal is over: show and mark nothing any more."""
        with self._lock:
            self._over = True
        self._taken.set()

    def use(self, fresh: bool) -> TakenImage:
        """Choose the image to draw on: a fresh one, or the one of the goal's beginning.

        :raises ImageSourceError: where there is none.
        """
        self._taken.wait()
        taken = self._take() if fresh else self._at_goal
        if taken is None:  # the camera may be back
            taken = self._take()
            self._at_goal = taken
        self._put_in_use(taken)
        return taken

    def image_in_use(self, stamp: rospy.Time) -> TakenImage:
        """The image in use.

        :param stamp: of the image that was drawn on. Zero for whichever is in use.
        :raises ImageSourceError: where there is none, or it is another one.
        """
        self._taken.wait()
        taken = self._in_use
        if taken is None:
            raise ImageSourceError(self._why_no_image)
        used = taken.message.header.stamp
        if not stamp.is_zero() and stamp != used:
            raise ImageSourceError(
                'drawn on the image of {:.3f} s, but that of {:.3f} s is in use'.format(
                    stamp.to_sec(), used.to_sec()
                )
            )
        return taken

    def mark(self, taken: TakenImage, region: np.ndarray, strokes: List[Stroke]) -> ObjectInImage:
        """Cut an object out of the image in use. `outputs` then hands it over.

        :param region: (n, 2) px, corners of a polygon.
        :raises SegmentationError: where that gives no object.
        """
        with self._lock:
            self._marked = None  # a failed attempt must not leave an earlier object to be accepted
        segmented = segment(taken.image, region, strokes)
        header = Header(stamp=taken.message.header.stamp, frame_id=self._base_frame)
        try:
            marked = ObjectInImage(segmented, header, scene_of(taken.image, segmented), '')
        except MarkedSceneError as err:
            marked = ObjectInImage(segmented, header, None, str(err))
        with self._lock:
            if taken is not self._in_use or self._over:
                raise SegmentationError('another image is in use by now', segmented.mask)
            self._marked = marked
        return marked

    def outputs(self, outcome: str, given: Collection[str] = ()) -> Mapping[str, OutputMessage]:
        """The outputs that the template lists for this outcome.

        :param given: output keys that the person gives. Nothing need be marked where they are all.
        :raises InterfaceGoalError: where nothing is marked, or the image did not show enough for
            an output.
        """
        wanted = {key: part for key, part in self.template.outputs.items() if key not in given}
        if outcome != self.template.outcome or not wanted:
            return {}
        marked = self._marked
        if marked is None:
            raise InterfaceGoalError(NO_MARK.format(', '.join(sorted(wanted))))
        of_scene = [key for key, part in wanted.items() if part in OF_THE_SCENE]
        if of_scene and marked.scene is None:
            raise InterfaceGoalError(
                '{}: {}'.format(', '.join(sorted(of_scene)), marked.why_no_scene)
            )
        messages = output_messages(marked)
        return {key: messages[part] for key, part in wanted.items()}

    def _take_first(self) -> None:
        try:
            self._at_goal = self._take()
            self._put_in_use(self._at_goal)
        except ImageSourceError as err:
            self._why_no_image = str(err)
        finally:
            self._taken.set()

    def _put_in_use(self, taken: TakenImage) -> None:
        with self._lock:
            if self._over:
                raise ImageSourceError('the goal has ended')
            self._in_use, self._marked = taken, None
        self._show(taken)


def output_messages(marked: ObjectInImage) -> Dict[str, OutputMessage]:
    """Messages for the names in OUTPUT_PARTS. Those of the scene only where it is known."""
    segmented = marked.segmented
    pose, size = box_messages(segmented.box, marked.header)
    cloud = cloud_message(segmented.points, marked.header, segmented.colours)
    messages: Dict[str, OutputMessage] = {'object': pose, 'size': size, 'cloud': cloud}
    if marked.scene is not None:
        others = [box_messages(box, marked.header) for box in marked.scene.others]
        messages.update(
            surface=box_messages(marked.scene.surface, marked.header)[0],
            objects=[pose] + [each for each, _ in others],
            sizes=[size] + [each for _, each in others],
        )
    return messages


def box_messages(box: UprightBox, header: Header) -> Tuple[PoseStamped, Vector3]:
    """Pose of the centre and extents (m) of a box, in the frame of `header`."""
    return (
        PoseStamped(header, Pose(Point(*box.centre), Quaternion(*quaternion(box.matrix)))),
        Vector3(*box.size),
    )
