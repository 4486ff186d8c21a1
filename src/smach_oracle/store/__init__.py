"""What a machine under the oracle keeps on disk to go on from after a crash. No ROS, no SMACH."""
