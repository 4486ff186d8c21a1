"""Whether the robot is well, by topics and diagnostics (setting `healthy`)."""
