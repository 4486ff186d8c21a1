"""A robot that is told to stop in the middle of a skill, as where the program behind it is gone."""

from smach_oracle.pr2.robot import RobotError


def stopped_after(robot, motions, for_good=False):
    """A robot that is told to stop in the motion after so many, and takes calls again then.

    :param for_good: it does not.
    """
    do, left = robot._do, [motions]

    def count(make):
        left[0] -= 1
        if left[0] == -1 or for_good and left[0] < 0:
            raise RobotError('the robot was told to stop')
        return do(make)

    robot._do = count
