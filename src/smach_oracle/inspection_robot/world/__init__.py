"""The ground truth: the hall, its people and its light, the robot's base, what its sensors get."""
