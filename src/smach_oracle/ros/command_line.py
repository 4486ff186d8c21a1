"""The command line of a node that is set by ROS parameters alone."""
import argparse

import rospy


def parameters_only(description: str) -> None:
    """Answer --help, and refuse any other argument that is no ROS remapping; both work without a master."""
    argparse.ArgumentParser(description=description).parse_args(rospy.myargv()[1:])
