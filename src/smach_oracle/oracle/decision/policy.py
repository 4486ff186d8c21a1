"""From a situation to a decision: Algorithm 1 and its alternatives (paper, IV-C). Pure.

doc/policies.md holds each policy as a table, cell by cell; the tests read those tables.

A policy is asked three things, in this order: is this a continuous failure; shall the preconditions
be run; and, once they have run, what now. Where a step back leads is the policy's business too.
"""
from enum import Enum
from typing import Dict, NamedTuple, Optional

from ..errors import SettingsError
from .failure_rate import FailureClass


class Action(str, Enum):
    """What the oracle does; the values are those of DECISION events."""

    REVISIT = 'revisit'  # enter the failed state again
    STEP_BACK = 'step_back'  # enter the state that the policy steps back to
    ASK = 'ask'  # ask the expert


class Preconditions(str, Enum):
    """How the failed state's preconditions stand when the policy decides."""

    NONE = 'none'
    MET = 'met'
    NOT_MET = 'not met'


class FailureContext(NamedTuple):
    """What the visits before say about a failure of `state`."""

    state: str
    # where a step back leads if nothing was before: the container's initial state, or with
    # `step_back_across` the path of the state that ran before in a container above
    initial: str
    failed_last: bool  # the container's most recent failure of this trial was of `state`
    failing_since: bool  # and `state` has not succeeded since
    unconditioned: Optional[str]  # state of the latest earlier visit that has no preconditions
    succeeded_before: Optional[str]  # other state that succeeded last before `state` began to fail


class Situation(NamedTuple):
    """One cell of a policy's table."""

    failure_class: FailureClass
    preconditions: Preconditions
    continuous: bool


class Policy:
    """Base of the policies; they hold no state."""

    name = ''

    def is_continuous(self, context: FailureContext) -> bool:
        """Whether this is a continuous failure in the policy's sense."""
        raise NotImplementedError

    def runs_preconditions(self, failure_class: FailureClass) -> bool:
        """Whether the preconditions of a failed state of this class are run."""
        return failure_class in (FailureClass.LOW, FailureClass.MODERATE)

    def decide(self, situation: Situation) -> Action:
        """Return what to do."""
        raise NotImplementedError

    def step_back_target(self, context: FailureContext) -> str:
        """Return the state that a step back leads to.

        It is a label of the container, or a path below the top machine, such as KITCHEN/LOOK or
        /HOME.
        """
        raise NotImplementedError


class Algorithm1(Policy):
    """The paper's listing, to the letter."""

    name = 'algorithm1'

    def is_continuous(self, context: FailureContext) -> bool:
        """The listing's Attempt: the failure before this one was of the same state."""
        return context.failed_last

    def decide(self, situation: Situation) -> Action:
        """Look the cell up."""
        failure_class, preconditions, continuous = situation
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
    """Section IV-C of the paper.

    Preconditions that cannot be met count as continuous: our reading, the prose is silent.
    """

    name = 'prose'

    def is_continuous(self, context: FailureContext) -> bool:
        """The failure before this one was of the same state, which has not succeeded since."""
        return context.failing_since

    def decide(self, situation: Situation) -> Action:
        """Look the cell up."""
        failure_class, preconditions, continuous = situation
        if failure_class not in (FailureClass.LOW, FailureClass.MODERATE):
            return Action.ASK
        if not continuous and preconditions is not Preconditions.NOT_MET:
            return Action.REVISIT
        return Action.STEP_BACK if failure_class is FailureClass.LOW else Action.ASK

    def step_back_target(self, context: FailureContext) -> str:
        """The last successful state before the failed one."""
        return context.initial if context.succeeded_before is None else context.succeeded_before


POLICIES: Dict[str, Policy] = {policy.name: policy for policy in (Algorithm1(), Prose())}


def policy_named(name: str) -> Policy:
    """Return the policy of this name.

    :raises SettingsError: where there is none of this name.
    """
    if name not in POLICIES:
        raise SettingsError('policy', name, ', '.join(sorted(POLICIES)))
    return POLICIES[name]
