"""The oracle as ROS's own tools see it: /diagnostics, and a plugin for roswtf."""
