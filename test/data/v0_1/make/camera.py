#!/usr/bin/env python3
"""A camera that sees one red pixel."""

import base64

import rospy
from sensor_msgs.msg import CompressedImage

PIXEL = (
    'iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAIAAACQd1PeAAAADElEQVQIHWP4z8AAAAMBAQBb2/lEAAAAAElFTkSuQmCC'
)


def main():
    """Until the node is stopped."""
    rospy.init_node('camera')
    publisher = rospy.Publisher('/camera/compressed', CompressedImage, queue_size=1)
    while not rospy.is_shutdown():
        publisher.publish(CompressedImage(format='png', data=base64.b64decode(PIXEL)))
        rospy.rostime.wallsleep(0.2)


if __name__ == '__main__':
    main()
