"""The command line of a node that is set by ROS parameters alone."""
import argparse

import rospy


def parameters_only(description: str) -> None:
    """Answer --help, and refuse any other argument that is not a ROS remapping.

    Both work without a master.

    Both work without a master.
    """
    argparse.ArgumentParser(description=description).parse_args(rospy.myargv()[1:])
