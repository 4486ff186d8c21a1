"""What an expert has marked while a goal is active: the frames to draw on, and the object cut out of one of them."""
import threading
from typing import Any, Callable, Collection, Dict, List, Mapping, NamedTuple, Optional

from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, Vector3
from std_msgs.msg import Header

from ..geometry.box import UprightBox
from ..geometry.transforms import quaternion
from ..ros.images import cloud_message
from .frame_source import FrameError, Shot
from .interface_goal import InterfaceGoalError
from .marked_scene import MarkedScene, SceneError, scene_of
from .output_templates import OF_THE_SCENE, StateTemplate
from .segmentation import Cutting, SegmentationError, Stroke, segment

NO_MARK = ('no object is marked, so {} cannot be told: mark it (call segment) first, give them with the outcome, '
           'choose another outcome, or give up')


class Marked(NamedTuple):
    """An object in the frame that it was marked in."""

    cutting: Cutting
    header: Header  # stamp of that frame, and the frame of the base
    scene: Optional[MarkedScene]
    why_no_scene: str


class Marking:
    """Of one goal. Its frame is taken by a thread of its own, for it takes a moment."""

    def __init__(self, template: StateTemplate, take: Callable[[], Shot], base_frame: str,
                 show: Callable[[Shot], None]) -> None:
        """
        :param take: a fresh frame, or FrameError.
        :param show: publishes the frame that is in use.
        """
        self.template = template
        self._take = take
        self._base_frame = base_frame
        self._show = show
        self._lock = threading.Lock()
        self._taken = threading.Event()
        self._over = False
        self._at_goal: Optional[Shot] = None
        self._in_use: Optional[Shot] = None
        self._why_no_frame = 'the frame of the goal has not come yet'
        self._marked: Optional[Marked] = None
        threading.Thread(target=self._take_first, name='frame of the goal', daemon=True).start()

    def end(self) -> None:
        """The goal is over: nothing is shown or marked any more."""
        with self._lock:
            self._over = True
        self._taken.set()

    def use(self, fresh: bool) -> Shot:
        """Choose the frame to draw on. Raises FrameError."""
        self._taken.wait()
        shot = self._take() if fresh else self._at_goal
        if shot is None:  # the camera may be back
            shot = self._take()
            self._at_goal = shot
        self._put_in_use(shot)
        return shot

    def frame(self, stamp: Any) -> Shot:
        """The frame in use.

        :param stamp: of the frame that was drawn on; zero for whichever is in use.
        :raises FrameError: where there is none, or it is another one.
        """
        self._taken.wait()
        shot = self._in_use
        if shot is None:
            raise FrameError(self._why_no_frame)
        used = shot.image.header.stamp
        if not stamp.is_zero() and stamp != used:
            raise FrameError('drawn on the frame of {:.3f} s, but that of {:.3f} s is in use'.format(
                stamp.to_sec(), used.to_sec()))
        return shot

    def mark(self, shot: Shot, region: Any, strokes: List[Stroke]) -> Marked:
        """Cut an object out of the frame in use; it is what accepting hands over. Raises SegmentationError."""
        with self._lock:
            self._marked = None  # a failed attempt must not leave an earlier object to be accepted
        cutting = segment(shot.picture, region, strokes)
        header = Header(stamp=shot.image.header.stamp, frame_id=self._base_frame)
        try:
            marked = Marked(cutting, header, scene_of(shot.picture, cutting), '')
        except SceneError as err:
            marked = Marked(cutting, header, None, str(err))
        with self._lock:
            if shot is not self._in_use or self._over:
                raise SegmentationError('another frame is in use by now', cutting.mask)
            self._marked = marked
        return marked

    def outputs(self, outcome: str, given: Collection[str] = ()) -> Mapping[str, Any]:
        """What the template says for this outcome.

        :param given: output keys that the person gives himself; nothing need be marked where they are all.
        :raises InterfaceGoalError: where nothing is marked, or the frame did not show what an output needs.
        """
        wanted = {key: what for key, what in self.template.outputs.items() if key not in given}
        if outcome != self.template.outcome or not wanted:
            return {}
        marked = self._marked
        if marked is None:
            raise InterfaceGoalError(NO_MARK.format(', '.join(sorted(wanted))))
        needy = [key for key, what in wanted.items() if what in OF_THE_SCENE]
        if needy and marked.scene is None:
            raise InterfaceGoalError('{}: {}'.format(', '.join(sorted(needy)), marked.why_no_scene))
        parts = ingredients(marked)
        return {key: parts[what] for key, what in wanted.items()}

    def _take_first(self) -> None:
        try:
            self._at_goal = self._take()
            self._put_in_use(self._at_goal)
        except FrameError as err:
            self._why_no_frame = str(err)
        finally:
            self._taken.set()

    def _put_in_use(self, shot: Shot) -> None:
        with self._lock:
            if self._over:
                raise FrameError('the goal has ended')
            self._in_use, self._marked = shot, None
        self._show(shot)


def ingredients(marked: Marked) -> Dict[str, Any]:
    """Messages for the names in output_templates.INGREDIENTS; those of the scene only where it is known."""
    cutting = marked.cutting
    pose, size = box_messages(cutting.box, marked.header)
    parts: Dict[str, Any] = {'object': pose, 'size': size,
                             'cloud': cloud_message(cutting.points, marked.header, cutting.colours)}
    if marked.scene is not None:
        others = [box_messages(box, marked.header) for box in marked.scene.others]
        parts.update(surface=box_messages(marked.scene.surface, marked.header)[0],
                     objects=[pose] + [each for each, _ in others], sizes=[size] + [each for _, each in others])
    return parts


def box_messages(box: UprightBox, header: Header) -> 'tuple':
    """Pose of the centre and extents of a box."""
    return (PoseStamped(header, Pose(Point(*box.centre), Quaternion(*quaternion(box.matrix)))), Vector3(*box.size))
