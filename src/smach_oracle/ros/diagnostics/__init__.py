"""What ROS's own tools see of the oracle: /diagnostics, and a plugin for roswtf."""
