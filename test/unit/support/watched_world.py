"""A world that remembers what has touched the robot."""

import pybullet

from smach_oracle.simulation.physics.world import World


class WatchedWorld(World):
    """Remembers what pressed against the robot in any control period; no planner has a say in
    it.
    """

    def reset(self, scene):
        self.touched = set()
        super().reset(scene)

    def step(self, count=1):
        for _ in range(count):
            super().step(1)
            # without the places and links that contacts() finds for each
            self.touched |= {
                self.seen_as(point[2])
                for point in pybullet.getContactPoints(
                    bodyA=self.robot.index, physicsClientId=self.client
                )
                if point[9] > 0
            }
