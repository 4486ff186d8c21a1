"""Policies to compare with: ways in an order that is given, or in one that is drawn."""

import random
from typing import Dict, Optional, Sequence, Tuple

from smach_oracle.oracle.decision.learned import Learned
from smach_oracle.oracle.decision.policies import POLICIES
from smach_oracle.oracle.decision.policy import Action, Baseline, Policy, Situation, draws_of
from smach_oracle.oracle.decision.ways import ChosenOrder, Way

ASK, GIVE_UP = 'ask', 'give_up'
WAIT_S = 30.0
# each way, as the executive has it. A wait is before the state is entered again
WAYS: Dict[str, Tuple[Action, float]] = {
    'retry': (Action.REVISIT, 0.0),
    'wait': (Action.REVISIT, WAIT_S),
    'step_back': (Action.STEP_BACK, 0.0),
    'restart': (Action.RESTART, 0.0),
    ASK: (Action.ASK, 0.0),
    GIVE_UP: (Action.GIVE_UP, 0.0),
}
DRAWN = ('retry', 'step_back', 'restart', ASK)


class Ordered(Baseline):
    """Tries ways in an order, the next at each recovery of a state in a trial. The last one stays.

    It goes by nothing else, and steps back as `prose` does.
    """

    name = 'ordered'
    restarts = True

    def __init__(self, ways: Sequence[str]) -> None:
        self.ways = tuple(ways)

    def order(self, situation: Situation) -> Sequence[str]:
        """Return the ways of this trial, in order."""
        return self.ways

    def _way(self, situation: Situation) -> Tuple[Action, float]:
        order = self.order(situation)
        return WAYS[order[min(situation.past.recoveries, len(order) - 1)]]

    def decide(self, situation: Situation) -> Action:
        """Return the action of the way that comes next."""
        return self._way(situation)[0]

    def may_do(self, situation: Situation) -> Tuple[Action, ...]:
        """Return the actions of all ways."""
        return tuple({WAYS[way][0]: None for way in self.ways})

    def wait_s(self, situation: Situation) -> float:
        """Return the wait of the way that comes next."""
        return self._way(situation)[1]


class Shuffled(Ordered):
    """Tries ways in an order that is drawn for each trial, each order as likely."""

    name = 'shuffled'

    def __init__(self, seed: object, ways: Sequence[str] = DRAWN) -> None:
        super().__init__(ways)
        self._seed = seed

    def order(self, situation: Situation) -> Sequence[str]:
        """Return the ways in the order of this trial."""
        ways = list(self.ways)
        random.Random('{} {}'.format(self._seed, situation.past.trial)).shuffle(ways)
        return ways


class ShuffledLabels(Learned):
    """Learns from the results of the ways after they have changed places: the control of learning.

    What it gains is not from what it has learned. The places are drawn at each failure.
    """

    name = 'shuffled_labels'
    draws = True

    def order(self, situation: Situation) -> Tuple[Way, ...]:
        """Return the order by the shuffled results."""
        return super().order(self._shuffled(situation))

    def choose(self, situation: Situation) -> ChosenOrder:
        """Return that order, and what it hopes for."""
        return super().choose(self._shuffled(situation))

    def _shuffled(self, situation: Situation) -> Situation:
        evidence = situation.menu.evidence
        known = [each for each in evidence.results if each.helped is not None]
        helped = [each.helped for each in known]
        draws_of(self.seed, situation.past).shuffle(helped)
        results = iter(helped)
        shuffled = tuple(
            each if each.helped is None else each._replace(helped=next(results))
            for each in evidence.results
        )
        menu = situation.menu._replace(evidence=evidence._replace(results=shuffled))
        return situation._replace(menu=menu)


class Arm:
    """A policy as a command line names it, or none.

    `bare` has no oracle. `order:retry,step_back,ask` tries these in this order, and `shuffled`
    tries `retry`, `step_back`, `restart` and `ask` in an order that is drawn. `shuffled_labels`
    learns as `learned` does, from results that have changed places. `ladder:wait_s=30` is
    a policy of the executive with a parameter. All others are such policies by name.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self._kind, _, rest = name.partition(':')
        parts = [part for part in rest.split(',') if part]
        self.is_bare = name == 'bare'
        self._ways: Tuple[str, ...] = tuple(parts) if self._kind == 'order' else ()
        self._parameters: Dict[str, float] = {}
        if self._kind == 'order':
            if not parts or set(parts) - set(WAYS):
                raise ValueError(
                    '{!r}: an order has some of {}'.format(name, ', '.join(sorted(WAYS)))
                )
        elif self._kind in POLICIES:
            self._parameters = {
                key: float(value) for key, _, value in (part.partition('=') for part in parts)
            }
            if set(self._parameters) - set(POLICIES[self._kind].parameters):
                raise ValueError(
                    '{!r}: allowed parameters: {}'.format(
                        name, ', '.join(sorted(POLICIES[self._kind].parameters)) or 'none'
                    )
                )
        elif name not in ('bare', 'shuffled', ShuffledLabels.name):
            raise ValueError(
                '{!r} is no policy. There are bare, shuffled, shuffled_labels, order:WAY,... '
                'and {}'.format(name, ', '.join(sorted(POLICIES)))
            )

    def policy(self, seed: object) -> Optional[Policy]:
        """Return the policy for the machine of that seed, None without an oracle."""
        if self.is_bare:
            return None
        if self._ways:
            return Ordered(self._ways)
        if self._kind == 'shuffled':
            return Shuffled(seed)
        if self._kind == ShuffledLabels.name:
            return ShuffledLabels(seed=1000.0 * int(str(seed)))
        given = dict(self._parameters)
        if POLICIES[self._kind].with_parameters(given).draws and 'seed' not in given:
            given['seed'] = 1000.0 * int(str(seed))
        return POLICIES[self._kind].with_parameters(given)
