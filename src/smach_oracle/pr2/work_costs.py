"""The costs of planning and perception: s of the world's time for each kind of work.

Costs go by the amount of work and never by a clock: the same question costs the same on any day
and under any load. The figures are orders of magnitude for the computers that a PR2 carries, not
measurements. On today's machines the same work takes a tenth of that, or less.
"""

from typing import NamedTuple

# With a millisecond for a check of the whole robot, a path of 75 to 1000 checks takes 0.1 to 1 s,
# and the budget of a path, 6000 checks, about the 5 s that MoveIt gives a planner by default.
CHECK_S = 0.001
# MoveIt gives an iterative solver of the inverse kinematics 5 ms by default. Many end before that.
SAMPLE_S = 0.003
# From the last pixel to a cloud of 300000 points, with colours and without the robot's own arms:
# a few images a second is what such a chain of nodes delivers.
IMAGE_S = 0.4
# To make out a plane and clusters in it: some passes more over the same points.
DETECTION_S = 1.0


class Work(NamedTuple):
    """An amount of work."""

    checks: int = 0  # configurations that were checked for collisions
    samples: int = 0  # starts of the inverse kinematics
    images: int = 0  # that were processed
    detections: int = 0  # of objects in an image

    @property
    def seconds(self) -> float:
        """s of the world's time that it takes."""
        return (
            self.checks * CHECK_S
            + self.samples * SAMPLE_S
            + self.images * IMAGE_S
            + self.detections * DETECTION_S
        )
