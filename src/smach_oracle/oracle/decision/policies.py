"""The policies by name, as the setting `policy` has them. Pure."""

from typing import Dict, Mapping, Tuple

from ..errors import SettingsError
from .by_ways import AnyWay, Escalating
from .learned import Learned
from .policy import Algorithm1, AlwaysAsk, Ladder, Policy, Prose, Random, Restart, Retry, StepBack

BASELINES: Tuple[Policy, ...] = (Restart(), Retry(), StepBack(), Random(), AlwaysAsk(), Ladder())
POLICIES: Dict[str, Policy] = {
    policy.name: policy
    for policy in (Algorithm1(), Prose(), Escalating(), Learned(), AnyWay(), *BASELINES)
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
