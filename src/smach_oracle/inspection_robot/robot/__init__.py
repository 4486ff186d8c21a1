"""What the robot makes of its sensors: where it is, where it can drive, what a gauge shows."""
