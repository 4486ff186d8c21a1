"""The operator's hand over ROS: services, a status, and what viewers send."""
