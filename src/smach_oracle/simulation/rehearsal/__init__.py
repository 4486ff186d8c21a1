"""Trials in one process, without ROS: for tests, tuning, pictures."""
