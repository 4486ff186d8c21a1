"""The simulated PR2 as a ROS node: the actions, topics and services that users of a PR2 know."""
