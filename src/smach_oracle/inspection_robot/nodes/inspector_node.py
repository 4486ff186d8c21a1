"""Reads the panel before the robot: the service `inspect`."""

import numpy as np
import rospy
from sensor_msgs.msg import Image
from std_srvs.srv import Trigger, TriggerRequest, TriggerResponse

from ..robot.reading import ReadingError, read
from .newest import NewestMessage
from .parameters import parameters_of

SILENT_S = 10.0  # wall time after which the camera is taken for dead
ENCODING = 'rgb8'


class Inspector:
    """Looks once for each call. It listens to the camera while it looks alone."""

    def __init__(self) -> None:
        self._service = rospy.Service('inspect', Trigger, self._inspect)

    def _inspect(self, _: TriggerRequest) -> TriggerResponse:
        """Answer `panel 2: 4.21 bar`, or why not."""
        try:
            found = read(self._image())
        except ReadingError as err:
            rospy.logwarn('inspect: %s', err)
            return TriggerResponse(False, str(err))
        return TriggerResponse(True, 'panel {}: {:.2f} bar'.format(found.number, found.bar))

    @staticmethod
    def _image() -> np.ndarray:
        """(h, w, 3): an image that is taken from now on.

        :raises ReadingError: where none comes, or of another kind.
        """
        camera = NewestMessage('camera/image_raw', Image)
        try:
            image = camera.after(rospy.Time.now(), SILENT_S)
        finally:
            camera.stop()
        if image is None:
            raise ReadingError('no image comes from the camera')
        if image.encoding != ENCODING or image.step != 3 * image.width:
            raise ReadingError('the image is {!r}, not {!r}'.format(image.encoding, ENCODING))
        return np.frombuffer(image.data, np.uint8).reshape(image.height, image.width, 3)


def main() -> None:
    """Entry point of the node."""
    parameters_of(
        'Node: reads the gauge before the inspection robot. It has no parameters; see '
        'doc/second_robot.md.'
    )
    rospy.init_node('inspection_inspector')
    inspector = Inspector()
    rospy.loginfo('%s: ready, %s', rospy.get_name(), type(inspector).__name__)
    rospy.spin()
