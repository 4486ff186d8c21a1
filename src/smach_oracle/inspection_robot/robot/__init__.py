"""The robot's conclusions from its sensors: where it is, where it can drive, what a gauge shows."""
