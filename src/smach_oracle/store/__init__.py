"""The file from which a machine under the oracle goes on after a crash. No ROS, no SMACH."""
