"""The old place of `smach_oracle.interfaces.interface_goal`, kept as an alias."""

import warnings

from smach_oracle.interfaces.interface_goal import (
    FinishServices,
    InterfaceGoal,
    InterfaceGoalError,
)

SettlingServices = FinishServices  # its name when it was here

__all__ = ['InterfaceGoal', 'InterfaceGoalError', 'SettlingServices']

warnings.warn(
    'smach_oracle.expert.interface_goal has moved to smach_oracle.interfaces.interface_goal',
    FutureWarning,
    stacklevel=2,
)
