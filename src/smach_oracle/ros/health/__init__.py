"""The health of the robot, by topics and diagnostics (setting `healthy`)."""
