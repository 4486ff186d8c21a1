"""The errors that may occur while a machine is built or run.

SmachError
├── InvalidStateError          a label or state that a container cannot take, or a child that failed
├── InvalidTransitionError     an outcome or a transition target that nobody registered
├── InvalidConstructionError   a container used outside of its ``with`` block
└── InvalidUserCodeError       a state's or callback's own code raised, or broke its userdata
contract
"""

import smach

__all__ = [
    'SmachError',
    'InvalidTransitionError',
    'InvalidStateError',
    'InvalidConstructionError',
    'InvalidUserCodeError',
]


class SmachError(Exception):
    """Root of all errors this package raises on its own account. Each one is logged where it is
    made.
    """

    def __init__(self, *args: object) -> None:
        super().__init__(*args)
        smach.logerr('%s: %s' % (type(self).__name__, self))


class InvalidStateError(SmachError):
    """A state or label cannot be used where it was given, or a child of a Concurrence failed."""


class InvalidTransitionError(SmachError):
    """An outcome, or the target of a transition, is not registered."""


class InvalidConstructionError(SmachError):
    """A container is used at a moment when it should have been opened."""


class InvalidUserCodeError(SmachError):
    """Code of a state or of a callback went wrong. The text carries its traceback."""
