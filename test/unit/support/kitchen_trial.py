"""Trials of the kitchen without a cause, in which tests begin some way in, each in a fork.

They begin where the same long way has led, and that is gone once for all of them.
"""

import pytest
from forked import Fork, in_a_fork
from watched_world import WatchedWorld

from smach_oracle.pr2.planning.arm import SkillError
from smach_oracle.pr2.robot import RobotError
from smach_oracle.simulation.rehearsal.drink_retrieval import DrinkRetrievalRehearsal
from smach_oracle.simulation.scenes.kitchen_scene import draw

STOPPED = 'the robot was told to stop'
ENDED = 99  # more motions than there are in a state: it has ended, and nobody was told


class _Begun:
    """A trial that has come some way."""

    def __init__(self, seed):
        self.world = WatchedWorld(draw(seed, benign=True), binning=2)
        self.trial = DrinkRetrievalRehearsal(self.world)
        self.done = 0  # of its states

    def go_on(self, states):
        for _, work in self.trial.states[self.done : states]:
            work()
        self.done = states


_begun = {}  # by seed


def _after(seed, states):
    """The trial of a seed after so many states: it goes on, or begins again."""
    begun = _begun.get(seed)
    if begun is None or begun.done > states:
        if begun is not None:
            begun.world.close()
        begun = _begun[seed] = _Begun(seed)
    begun.go_on(states)
    return begun


def in_kitchen(seed, states, work):
    """Do `work(world, trial)` in a fork, after the first `states` states of a seed's trial.

    Tests that ask for fewer states than one before them let the trial begin again.

    :returns: what it returns, which can be pickled.
    """
    begun = _after(seed, states)
    return in_a_fork(lambda: work(begun.world, begun.trial))


def stopped_in_kitchen(
    seed, states, motions, work, for_good=True, failure=(RobotError, SkillError)
):
    """Stop the robot within the state after the first `states` ones, and do `work(world, trial)`.

    This is done in a fork for each of these numbers of motions, after which it is stopped; the
    state goes on to its end here.

    :param for_good: the robot takes no calls again before `work`.
    :param failure: with which the state then fails.
    :returns: by the number of motions, a fork that has the answer.
    """
    begun = _after(seed, states)
    robot, world, trial = begun.trial.robot, begun.world, begun.trial
    do, forks, inside, done = robot._do, {}, [], 0

    def branches(number):
        """Whether this is a fork that was made here."""
        fork = forks[number] = Fork()
        if fork.inside:
            inside.append(fork)
        else:
            fork.wait()
        return fork.inside

    def count(make):
        nonlocal done
        if inside:
            if for_good:
                raise RobotError(STOPPED)
            return do(make)
        done += 1
        if done - 1 in motions and branches(done - 1):
            raise RobotError(STOPPED)
        return do(make)

    robot._do, error = count, None
    try:
        begun.go_on(states + 1)
    except BaseException as err:
        if not inside:
            raise
        error = err

    def after_the_stop():
        with pytest.raises(failure, match='told to stop'):
            if error is not None:
                raise error
        robot._do = do
        return work(world, trial)

    if inside:
        inside[0].end_with(after_the_stop)
    robot._do = do
    if ENDED in motions and branches(ENDED):
        inside[0].end_with(lambda: work(world, trial))
    return forks
