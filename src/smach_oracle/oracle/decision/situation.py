"""Situations that a policy decides about, and its possible actions (paper, IV-C). Pure.

A policy is asked three things, in this order: is this a continuous failure. Must the preconditions
be run, and, once they have run, what now. Where a step back leads is the policy's business too.
"""

from enum import Enum
from typing import Mapping, NamedTuple, Optional, Tuple

from .failure_rate import FailureClass


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


class Situation(NamedTuple):
    """One cell of a policy's table, and what has been done before."""

    failure_class: FailureClass
    preconditions: Preconditions
    continuous: bool
    past: Past = Past()


class Policy:
    """The base of the policies. They hold no state.

    >>> from smach_oracle.oracle import FailureClass
    >>> from smach_oracle.oracle.decision.policy import Preconditions, Situation, policy_named
    >>> often = Situation(FailureClass.HIGH, Preconditions.NONE, continuous=True)
    >>> policy_named('prose').decide(often).value
    'ask'
    >>> policy_named('retry', {'times': 5}).decide(often).value
    'revisit'

    `asks`: whether it may ask. A policy that may not ask ends the container where others would ask.
    `draws`: whether it wants to know the place of the failure (`Past.place`). `parameters`: the
    values that may be set, with their defaults.
    """

    name = ''
    asks = True
    restarts = False  # whether it may start the script over
    draws = False
    parameters: Mapping[str, float] = {}

    def with_parameters(self, given: Mapping[str, float]) -> 'Policy':
        """Return the policy with other parameters, all of which are among its own."""
        return type(self)(**given) if given else self

    def is_continuous(self, context: FailureContext) -> bool:
        """Whether this is a continuous failure in the policy's sense."""
        raise NotImplementedError

    def runs_preconditions(self, failure_class: FailureClass) -> bool:
        """Whether the preconditions of a failed state of this class are run."""
        return failure_class in (FailureClass.LOW, FailureClass.MODERATE)

    def decide(self, situation: Situation) -> Action:
        """Return what to do."""
        raise NotImplementedError

    def may_do(self, situation: Situation) -> Tuple[Action, ...]:
        """Return all that `decide` may return. More than one action where that is drawn."""
        return (self.decide(situation),)

    def why(self, situation: Situation) -> str:
        """Say why it gives up or asks, as a clause, or '' where its cell says it all."""
        return ''

    def wait_s(self, situation: Situation) -> float:
        """Return how many seconds are waited before the decision is carried out."""
        return 0.0

    def step_back_target(self, context: FailureContext) -> str:
        """Return the state that a step back leads to.

        It is a label of the container, or a path below the top machine, such as KITCHEN/LOOK or
        /HOME.
        """
        raise NotImplementedError
