"""The subsystems as ROS nodes."""
