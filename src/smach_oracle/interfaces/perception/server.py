"""The perception interface: a person marks the object that a failed detection did not find.

A SharedAutonomy action beside `~image` and `~cloud` (the image in use), `~segment`, `~use_frame`,
`~finish` and `~give_up`, for any robot with a camera that gives colour and registered depth, and a
tf tree from it to the base.
"""

import time
from typing import Collection, List, Mapping, Optional

import numpy as np
import rospy
from sensor_msgs.msg import Image, PointCloud2

from smach_oracle.msg import SegmentStroke, SharedAutonomyGoal
from smach_oracle.oracle.asking.question import names
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.ros.command_line import parameters_only
from smach_oracle.ros.images import mask_image
from smach_oracle.ros.master_watch import start_master_watch
from smach_oracle.ros.parameters import name_of, number_of
from smach_oracle.srv import (
    SegmentObject,
    SegmentObjectRequest,
    SegmentObjectResponse,
    UseFrame,
    UseFrameRequest,
    UseFrameResponse,
)

from ..interface_goal import NO_GOAL, FinishServices, InterfaceGoal
from ..priority import take_priority
from .image_source import NO_SNAPSHOT, ImageSource, ImageSourceError, TakenImage, cloud_of
from .marking import ObjectMarking, OutputMessage, output_messages
from .output_templates import templates_from
from .segmentation import SegmentationError, Stroke, rectangle

_WATCH_S = 0.5
MOST_POINTS = 10000  # of a polygon, and of a request's strokes together


class SegmentationServer:
    """Hosts the interface."""

    def __init__(self, states: object, source: ImageSource) -> None:
        """
        :param states: templates by state, see output_templates.
        :raises SettingsError: for a template that cannot be used.
        """
        self._templates = templates_from(states)
        self._source = source
        self._marking: Optional[ObjectMarking] = None
        self._image = rospy.Publisher('~image', Image, queue_size=2, latch=True)
        self._cloud = rospy.Publisher('~cloud', PointCloud2, queue_size=2, latch=True)
        self._goal = InterfaceGoal(rospy.get_name(), self._begun, self._ended)
        self._finish_services = FinishServices(self._goal, self._outputs)
        self._services = [
            rospy.Service('~segment', SegmentObject, self._segment, buff_size=1 << 20),
            rospy.Service('~use_frame', UseFrame, self._use_frame),
        ]

    def watch(self) -> None:
        """Drop goals whose asker is gone, until the node ends."""
        while not rospy.is_shutdown():
            self._goal.drop_if_asker_is_gone()
            time.sleep(_WATCH_S)

    def _begun(self, goal: SharedAutonomyGoal) -> None:
        if goal.state not in self._templates:
            raise ValueError(
                'state {!r}: no outputs are known for it; known: {}'.format(
                    goal.state, names(sorted(self._templates))
                )
            )
        self._marking = ObjectMarking(
            self._templates[goal.state], self._source.take, self._source.base_frame, self._show
        )

    def _ended(self) -> None:
        marking, self._marking = self._marking, None
        if marking is not None:
            marking.end()

    def _outputs(self, outcome: str, given: Collection[str]) -> Mapping[str, OutputMessage]:
        marking = self._marking
        return marking.outputs(outcome, given) if marking is not None else {}

    def _show(self, taken: TakenImage) -> None:
        self._image.publish(taken.message)
        self._cloud.publish(cloud_of(taken, self._source.base_frame))
        self._goal.tell(0.2, 'the image is shown: mark the object')

    def _use_frame(self, request: UseFrameRequest) -> UseFrameResponse:
        marking = self._marking
        if marking is None:
            return UseFrameResponse(ok=False, message=NO_GOAL)
        if request.frame not in (UseFrameRequest.AT_GOAL, UseFrameRequest.FRESH):
            return UseFrameResponse(
                ok=False,
                message='frame {} is unknown; allowed: AT_GOAL (0), FRESH (1)'.format(
                    request.frame
                ),
            )
        try:
            taken = marking.use(request.frame == UseFrameRequest.FRESH)
        except ImageSourceError as err:
            return UseFrameResponse(ok=False, message=str(err))
        return UseFrameResponse(ok=True, stamp=taken.message.header.stamp)

    def _segment(self, request: SegmentObjectRequest) -> SegmentObjectResponse:
        marking, begun_s = self._marking, time.monotonic()
        if marking is None:
            return SegmentObjectResponse(ok=False, message=NO_GOAL)
        response = SegmentObjectResponse()
        taken: Optional[TakenImage] = None
        try:
            region, strokes = region_of(request), strokes_of(request.strokes)
            taken = marking.image_in_use(request.stamp)
            marked = marking.mark(taken, region, strokes)
        except (ImageSourceError, SegmentationError) as err:
            response.message = str(err)
            mask = getattr(err, 'mask', None)
        else:
            parts = output_messages(marked)
            response.ok, response.message, mask = True, marked.why_no_scene, marked.segmented.mask
            response.object, response.size = parts['object'], parts['size']
            response.cloud = parts['cloud']
            self._goal.tell(
                0.8,
                'an object of {:.0f} x {:.0f} x {:.0f} cm is marked'.format(
                    *(100 * marked.segmented.box.size)
                ),
            )
        if mask is not None and taken is not None:
            response.mask = mask_image(mask, taken.message.header)
        response.elapsed = time.monotonic() - begun_s
        return response


def region_of(request: SegmentObjectRequest) -> np.ndarray:
    """(n, 2) px: the corners of the region that was drawn.

    :raises SegmentationError: where there is none, or it has too many corners.
    """
    corners, box = request.polygon.points, request.region
    if len(corners) > MOST_POINTS:
        raise SegmentationError(
            'the polygon has {} corners; allowed: {}'.format(len(corners), MOST_POINTS)
        )
    if corners:
        return np.array([[point.x, point.y] for point in corners], float)
    if not box.width or not box.height:
        raise SegmentationError(
            'no region: a rectangle with width and height, or a polygon, is needed'
        )
    return rectangle(box.x_offset, box.y_offset, box.width, box.height)


def strokes_of(messages: List[SegmentStroke]) -> List[Stroke]:
    """The strokes of a request.

    :raises SegmentationError: for more points than anybody draws.
    """
    if sum(len(message.points) for message in messages) > MOST_POINTS:
        raise SegmentationError('the strokes have more than {} points'.format(MOST_POINTS))
    return [
        Stroke(
            message.foreground,
            np.array([[point.x, point.y] for point in message.points], float).reshape(-1, 2),
            message.width,
        )
        for message in messages
    ]


def main() -> None:
    """Entry point of the node."""
    parameters_only(
        'Node: a person marks objects in camera images in place of a failed detection. '
        'Parameters: ~rgb, ~depth, ~camera_info, ~snapshot, ~base_frame, ~frame_limit_s, '
        '~states, ~nice; see doc/perception.md.'
    )
    rospy.init_node('perception_interface')
    start_master_watch()
    try:
        take_priority()
        server = SegmentationServer(rospy.get_param('~states', {}), _source())
    except SettingsError as err:
        rospy.logfatal('perception_interface: %s', err)
        raise SystemExit(2) from err
    rospy.loginfo('%s: waiting for the oracle', rospy.get_name())
    server.watch()


def _source() -> ImageSource:
    return ImageSource(
        name_of('~rgb', 'head_camera/rgb/image_raw'),
        name_of('~depth', 'head_camera/depth_registered/image_raw'),
        name_of('~camera_info', 'head_camera/rgb/camera_info'),
        name_of('~base_frame', 'base_footprint'),
        name_of('~snapshot', NO_SNAPSHOT),
        number_of('~frame_limit_s', 20.0, 0.1, 600.0),
    )
