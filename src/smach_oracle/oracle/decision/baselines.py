"""Policies that go by neither rates nor preconditions: what the others are measured against. Pure.

Each counts what was done in the trial. None runs preconditions. doc/policies.md holds them as a
table.
"""

import random
from typing import Mapping, Tuple

from .failure_rate import FailureClass
from .situation import Action, FailureContext, Policy, Situation


def _times(count: int, one: str, many: str) -> str:
    return '1 ' + one if count == 1 else '{} {}'.format(count, many)


class Baseline(Policy):
    """The methods that all baselines have in common."""

    def is_continuous(self, context: FailureContext) -> bool:
        """Return whether the last failure was of the same state, which has not succeeded since."""
        return context.failing_since

    def runs_preconditions(self, failure_class: FailureClass) -> bool:
        """Return False: a baseline never runs preconditions."""
        return False

    def step_back_target(self, context: FailureContext) -> str:
        """Return the last successful state before the failed one, as `prose` does."""
        return context.initial if context.succeeded_before is None else context.succeeded_before


class Repeating(Baseline):
    """Does one thing, at most `times` times in a trial, and then gives up."""

    asks = False
    parameters: Mapping[str, float] = {'times': 2}
    action = Action.REVISIT
    done = ('retry', 'retries')

    def __init__(self, times: float = 2) -> None:
        self.times = int(times)

    def spent(self, situation: Situation) -> int:
        """Return how often it was done before."""
        return situation.past.recoveries

    def decide(self, situation: Situation) -> Action:
        """Do it again, until that has been done often enough."""
        return self.action if self.spent(situation) < self.times else Action.GIVE_UP

    def why(self, situation: Situation) -> str:
        """Say that it was done often enough."""
        if self.spent(situation) < self.times:
            return ''
        if not self.times:
            return 'no {} allowed'.format(self.done[1] + ' are')
        return 'its {} spent'.format(
            _times(self.times, self.done[0] + ' is', self.done[1] + ' are')
        )


class Retry(Repeating):
    """Enters the failed state again."""

    name = 'retry'


class StepBack(Repeating):
    """Steps back to the last successful state before the failed one."""

    name = 'step_back'
    action = Action.STEP_BACK
    done = ('step back', 'steps back')


class Restart(Repeating):
    """Starts the script over: its top machine, from the initial state."""

    name = 'restart'
    restarts = True
    action = Action.RESTART
    done = ('restart', 'restarts')

    def spent(self, situation: Situation) -> int:
        """Return how often the top machine was started over."""
        return situation.past.restarts

    def why(self, situation: Situation) -> str:
        """Say that it was done often enough, in this trial."""
        return super().why(situation).replace('its ', "the trial's ", 1)


class AlwaysAsk(Baseline):
    """Asks about every failure."""

    name = 'always_ask'

    def decide(self, situation: Situation) -> Action:
        """Return `Action.ASK`, whatever has failed."""
        return Action.ASK


class Random(Baseline):
    """Draws one of the three actions of the paper, each as likely as the others.

    What is drawn depends on `seed`, the number of the trial, the state and how often it was visited
    in the trial, and on nothing else: no order of threads changes it.
    """

    name = 'random'
    draws = True
    parameters: Mapping[str, float] = {'seed': 0}
    actions = (Action.REVISIT, Action.STEP_BACK, Action.ASK)

    def __init__(self, seed: float = 0) -> None:
        self.seed = int(seed)

    def decide(self, situation: Situation) -> Action:
        """Return an action that is drawn at random."""
        past = situation.past
        drawn = random.Random('{} {}'.format(self.seed + past.trial, past.place)).random()
        return self.actions[int(drawn * len(self.actions))]

    def may_do(self, situation: Situation) -> Tuple[Action, ...]:
        """Return all three: any of them can be drawn."""
        return self.actions


class Ladder(Baseline):
    """Does as deployed robots do: wait and try again, step back a few times, then ask."""

    name = 'ladder'
    parameters: Mapping[str, float] = {'wait_s': 5.0, 'tries': 1, 'steps_back': 3}

    def __init__(self, wait_s: float = 5.0, tries: float = 1, steps_back: float = 3) -> None:
        self.pause_s = float(wait_s)
        self.tries = int(tries)
        self.steps_back = int(steps_back)

    def decide(self, situation: Situation) -> Action:
        """Go one rung up at each failure of the state in this trial."""
        recoveries = situation.past.recoveries
        if recoveries < self.tries:
            return Action.REVISIT
        return Action.STEP_BACK if recoveries < self.tries + self.steps_back else Action.ASK

    def wait_s(self, situation: Situation) -> float:
        """Wait before the state is tried again."""
        return self.pause_s if self.decide(situation) is Action.REVISIT else 0.0

    def why(self, situation: Situation) -> str:
        """Say what has been done."""
        if self.decide(situation) is not Action.ASK:
            return ''
        return 'its {} and {} are spent'.format(
            _times(self.tries, 'retry', 'retries'),
            _times(self.steps_back, 'step back', 'steps back'),
        )


BASELINES: Tuple[Policy, ...] = (Restart(), Retry(), StepBack(), Random(), AlwaysAsk(), Ladder())
