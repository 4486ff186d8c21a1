"""From a situation to a decision: Algorithm 1 and its alternatives (paper, IV-C). Pure.

doc/policies.md holds each policy as a table, cell by cell. The tests read those tables.
"""

from typing import Dict, Mapping

from ..errors import SettingsError
from .baselines import BASELINES
from .failure_rate import FailureClass
from .situation import Action, FailureContext, Past, Policy, Preconditions, Situation

__all__ = [
    'Action',
    'Algorithm1',
    'FailureContext',
    'POLICIES',
    'Past',
    'Policy',
    'Preconditions',
    'Prose',
    'Situation',
    'policy_named',
]


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

    def is_continuous(self, context: FailureContext) -> bool:
        """Return whether the last failure was of the same state, which has not succeeded since."""
        return context.failing_since

    def decide(self, situation: Situation) -> Action:
        """Look the cell up."""
        failure_class, preconditions, continuous = situation[:3]
        if failure_class not in (FailureClass.LOW, FailureClass.MODERATE):
            return Action.ASK
        if not continuous and preconditions is not Preconditions.NOT_MET:
            return Action.REVISIT
        return Action.STEP_BACK if failure_class is FailureClass.LOW else Action.ASK

    def step_back_target(self, context: FailureContext) -> str:
        """Return the last successful state before the failed one."""
        return context.initial if context.succeeded_before is None else context.succeeded_before


POLICIES: Dict[str, Policy] = {
    policy.name: policy for policy in (Algorithm1(), Prose(), *BASELINES)
}
NO_PARAMETERS: Mapping[str, float] = {}


def policy_named(name: str, parameters: Mapping[str, float] = NO_PARAMETERS) -> Policy:
    """Return the policy of this name.

    :param parameters: where they are not the defaults. They have been checked.
    :raises SettingsError: where there is none of this name.
    """
    if name not in POLICIES:
        raise SettingsError('policy', name, ', '.join(sorted(POLICIES)))
    return POLICIES[name].with_parameters(parameters)
