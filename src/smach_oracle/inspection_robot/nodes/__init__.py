"""The ROS nodes: the world, the navigator, the inspector."""
