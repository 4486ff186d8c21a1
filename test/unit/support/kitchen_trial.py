"""Trials of the kitchen without a cause, in which tests begin some way in, each in a fork.

They begin where the same long way has led, and that is gone once for all of them.
"""

from forked import in_a_fork

from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.rehearsal.drink_retrieval import DrinkRetrievalRehearsal
from smach_oracle.simulation.scenes.kitchen_scene import draw


class _Begun:
    """A trial that has come some way."""

    def __init__(self, seed):
        self.world = World(draw(seed, benign=True), binning=2)
        self.trial = DrinkRetrievalRehearsal(self.world)
        self.done = 0  # of its states

    def go_on(self, states):
        for _, work in self.trial.states[self.done : states]:
            work()
        self.done = states


_begun = {}  # by seed


def in_kitchen(seed, states, work):
    """Do `work(world, trial)` in a fork, after the first `states` states of a seed's trial.

    Tests that ask for fewer states than one before them let the trial begin again.
    """
    begun = _begun.get(seed)
    if begun is None or begun.done > states:
        if begun is not None:
            begun.world.close()
        begun = _begun[seed] = _Begun(seed)
    begun.go_on(states)
    in_a_fork(lambda: work(begun.world, begun.trial))
