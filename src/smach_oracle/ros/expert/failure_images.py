"""Publishes what the robot's cameras saw when a question was put, on a latched topic.

The cameras are listened to all the time, for the frame must be there when the failure is. Nothing
of it is waited for.
"""

import threading
from typing import Dict, List, Sequence, Tuple

import rospy
from sensor_msgs.msg import CompressedImage, Image

from smach_oracle.msg import FailureFrames
from smach_oracle.oracle.asking.question import Question

from ..connections import quiet_at_shutdown
from ..images import colour_of
from ..log.said_once import warn_once
from ..replay.known_topics import KnownTopics
from ..replay.replay_settings import CAMERA_TYPES, camera_topics
from ..replay.small_images import CameraMessage, jpeg_of

TOPIC = '~failure_frames'
JPEG_QUALITY = 85
OLDEST_S = 10.0  # ROS time: an older image does not show the failure


class FailureCameras:
    """Holds the newest image of each camera of a node, and publishes them with a question."""

    def __init__(self, topics: Sequence[str]) -> None:
        """`topics` of type Image or CompressedImage, four at most, in colour or grey.

        :raises SettingsError: where they are no names of topics, or more.
        """
        self._topics = camera_topics(topics)
        self._newest: Dict[str, Tuple[CameraMessage, rospy.Time]] = {}  # and when it came
        self._lock = threading.Lock()
        if self._topics:
            self._publisher = rospy.Publisher(TOPIC, FailureFrames, latch=True, queue_size=5)
        self._listening = KnownTopics(self._topics, CAMERA_TYPES, self._keep, 'failure cameras')

    def publish_for(self, question: Question) -> None:
        """Publish the newest images, in a thread of its own.

        Nothing is published where no camera has been heard lately.
        """
        now = rospy.get_rostime()
        with self._lock:
            newest = [
                (topic, *self._newest[topic]) for topic in self._topics if topic in self._newest
            ]
        images = [
            (topic, image)
            for topic, image, came in newest
            if abs((now - came).to_sec()) <= OLDEST_S
        ]
        if images:
            threading.Thread(
                target=self._publish, args=(question, images), name='failure images', daemon=True
            ).start()

    def stop(self) -> None:
        """Listen no longer."""
        self._listening.stop()

    def _keep(self, image: CameraMessage, topic: str) -> None:
        with self._lock:
            self._newest[topic] = image, rospy.get_rostime()

    def _publish(self, question: Question, images: List[Tuple[str, CameraMessage]]) -> None:
        message = FailureFrames(trial_id=question.trial_id, query_id=question.question_id)
        for topic, image in images:
            try:
                message.images.append(compressed(image))
                message.topics.append(topic)
            except ValueError as err:
                warn_once(
                    'The images of {} at failures cannot be published: {}. This is said '
                    'once'.format(topic, err)
                )
        message.header.stamp = rospy.get_rostime()
        if message.images and not rospy.is_shutdown():
            with quiet_at_shutdown():
                self._publisher.publish(message)


def compressed(image: CameraMessage) -> CompressedImage:
    """Return a JPEG of an Image. A CompressedImage as it is.

    :raises ValueError: where the image is not in colour or grey.
    """
    if not isinstance(image, Image):
        return image
    return jpeg_of(colour_of(image), image.header, JPEG_QUALITY)
