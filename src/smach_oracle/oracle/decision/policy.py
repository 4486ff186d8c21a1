"""From a situation to a decision: Algorithm 1, its alternatives, and baselines (paper, IV-C). Pure.

A policy is asked three things, in this order: is this a continuous failure. Must the preconditions
be run, and, once they have run, what now. Where a step back leads is the policy's business too.
doc/policies.md holds each policy as a table, cell by cell. The tests read those tables.
"""

import random
from enum import Enum
from typing import Mapping, NamedTuple, Optional, Tuple

from .failure_rate import FailureClass
from .ways import RESTORE, ChosenOrder, Evidence, Prices, StreakSoFar, Way


class Action(str, Enum):
    """An action of the oracle. The values are those of DECISION events."""

    REVISIT = 'revisit'  # enter the failed state again
    STEP_BACK = 'step_back'  # enter the state that the policy steps back to
    RESTART = 'restart'  # enter the top machine's initial state, with the userdata of the start
    ASK = 'ask'  # ask the expert
    GIVE_UP = 'give_up'  # end the container as without an oracle


class Preconditions(str, Enum):
    """Whether the failed state's preconditions are met when the policy decides."""

    NONE = 'none'
    MET = 'met'
    NOT_MET = 'not met'


class FailureContext(NamedTuple):
    """The facts that the visits before give about a failure of `state`."""

    state: str
    # where a step back leads if nothing was before: the container's initial state, or with
    # `step_back_across` the path of the state that ran before in a container above
    initial: str
    failed_last: bool  # the container's most recent failure of this trial was of `state`
    failing_since: bool  # and `state` has not succeeded since
    unconditioned: Optional[str]  # state of the latest earlier visit that has no preconditions
    succeeded_before: Optional[str]  # other state that succeeded last before `state` began to fail


class Past(NamedTuple):
    """The history of this trial before a decision."""

    recoveries: int = 0  # by the oracle itself, from failures of this state
    restarts: int = 0  # of the top machine
    place: str = ''  # path of the state, and its visits in this trial, for a policy that draws
    trial: int = 0  # how many trials the machine has begun before this one
    attempts: int = 0  # recoveries of this trial, from failures of all states
    usual_minutes: Optional[float] = None  # the median of earlier trials. None: there was none


class Menu(NamedTuple):
    """What a policy that goes by ways chooses from. `ways`: those of the failure, in any order.

    `has_expert`: somebody can be asked. `evidence`: for a policy that learns.
    """

    ways: Tuple[Way, ...] = ()
    streak: StreakSoFar = StreakSoFar()
    prices: Prices = Prices()
    has_expert: bool = True
    evidence: Evidence = Evidence()


class Situation(NamedTuple):
    """One cell of a policy's table, and what has been done before."""

    failure_class: FailureClass
    preconditions: Preconditions
    continuous: bool
    past: Past = Past()
    menu: Menu = Menu()


class Policy:
    """The base of the policies. They hold no state.

    >>> from smach_oracle.oracle import FailureClass
    >>> from smach_oracle.oracle.decision.policies import policy_named
    >>> from smach_oracle.oracle.decision.policy import Preconditions, Situation
    >>> often = Situation(FailureClass.HIGH, Preconditions.NONE, continuous=True)
    >>> policy_named('prose').decide(often).value
    'ask'
    >>> policy_named('retry', {'times': 5}).decide(often).value
    'revisit'

    `asks`: whether it may ask. A policy that may not ask ends the container where others would ask.
    `draws`: whether it wants to know the place of the failure (`Past.place`). `parameters`: the
    values that may be set, with their defaults. `goes_by_ways`: whether it chooses from the menu
    (`choose`), and not by a table (`decide`). `learns`: whether it wants to know what the ways have
    led to (`Menu.evidence`). `userdata`: that of its jumps, unless a user sets it.
    """

    name = ''
    asks = True
    goes_by_ways = False
    learns = False
    # decisions of its own that lead to a state, of a streak and of a trial. None: it has no menu
    most_of_streak: Optional[int] = None
    most_of_trial: Optional[int] = None
    userdata = RESTORE
    restarts = False  # whether it may start the script over
    draws = False
    parameters: Mapping[str, float] = {}

    def with_parameters(self, given: Mapping[str, float]) -> 'Policy':
        """Return the policy with other parameters, all of which are among its own."""
        return type(self)(**given) if given else self

    def is_continuous(self, context: FailureContext) -> bool:
        """Whether this is a continuous failure in the policy's sense.

        Here the last failure was of the same state, which has not succeeded since.
        """
        return context.failing_since

    def runs_preconditions(self, failure_class: FailureClass) -> bool:
        """Whether the preconditions of a failed state of this class are run."""
        return failure_class in (FailureClass.LOW, FailureClass.MODERATE)

    def decide(self, situation: Situation) -> Action:
        """Return what to do."""
        raise NotImplementedError

    def may_do(self, situation: Situation) -> Tuple[Action, ...]:
        """Return all that `decide` may return. More than one action where that is drawn."""
        return (self.decide(situation),)

    def order(self, situation: Situation) -> Tuple[Way, ...]:
        """Return the ways that it would go, in this order. It asks where none is left.

        For a policy that goes by ways.
        """
        raise NotImplementedError

    def choose(self, situation: Situation) -> ChosenOrder:
        """Return the ways in the order in which it goes them now, and what led to it.

        It is that of `order`, unless another one was drawn.
        """
        return ChosenOrder(self.order(situation))

    def chance_of(self, situation: Situation, key: str) -> float:
        """Return the chance with which it goes a way first. `key`: of the way, '' is to ask.

        For a policy that goes by ways.
        """
        order = self.order(situation)
        return float(key == (order[0].key if order else ''))

    def why(self, situation: Situation) -> str:
        """Say why it gives up or asks, as a clause, or '' where its cell says it all."""
        return ''

    def wait_s(self, situation: Situation) -> float:
        """Return how many seconds are waited before the decision is carried out."""
        return 0.0

    def step_back_target(self, context: FailureContext) -> str:
        """Return the state that a step back leads to.

        It is a label of the container, or a path below the top machine, such as KITCHEN/LOOK or
        /HOME. Here it is the last successful state before the failed one.
        """
        return context.initial if context.succeeded_before is None else context.succeeded_before


class Algorithm1(Policy):
    """The policy of the paper's listing, Algorithm 1, to the letter."""

    name = 'algorithm1'

    def is_continuous(self, context: FailureContext) -> bool:
        """Return whether the failure before was of the same state, the listing's Attempt."""
        return context.failed_last

    def decide(self, situation: Situation) -> Action:
        """Look the cell up."""
        failure_class, preconditions, continuous = situation[:3]
        if failure_class is FailureClass.LOW:
            return Action.REVISIT if preconditions is Preconditions.NOT_MET else Action.STEP_BACK
        if failure_class is FailureClass.MODERATE and not continuous:
            return Action.REVISIT if preconditions is Preconditions.MET else Action.STEP_BACK
        return Action.ASK

    def step_back_target(self, context: FailureContext) -> str:
        """Return the listing's Rs.

        It is the state of the latest earlier visit, of whichever state, without preconditions.
        """
        return context.initial if context.unconditioned is None else context.unconditioned


class Prose(Policy):
    """The policy that the text of section IV-C of the paper describes.

    Preconditions that cannot be met count as continuous: our reading, the prose is silent.
    """

    name = 'prose'

    def decide(self, situation: Situation) -> Action:
        """Look the cell up."""
        failure_class, preconditions, continuous = situation[:3]
        if failure_class not in (FailureClass.LOW, FailureClass.MODERATE):
            return Action.ASK
        if not continuous and preconditions is not Preconditions.NOT_MET:
            return Action.REVISIT
        return Action.STEP_BACK if failure_class is FailureClass.LOW else Action.ASK


# -- baselines, which go by neither rates nor preconditions: the others are measured against them


def _times(count: int, one: str, many: str) -> str:
    return '1 ' + one if count == 1 else '{} {}'.format(count, many)


def draws_of(seed: int, past: Past) -> random.Random:
    """Return what a policy draws from, for one failure of one trial."""
    return random.Random('{} {}'.format(seed + past.trial, past.place))


class Baseline(Policy):
    """The methods that all baselines have in common, and those policies that go by ways."""

    def runs_preconditions(self, failure_class: FailureClass) -> bool:
        """Return False: it never runs preconditions before it decides."""
        return False


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
        drawn = draws_of(self.seed, situation.past).random()
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
