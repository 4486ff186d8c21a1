"""The errors that the test kit raises.

OracleError
+-- FaultError (also a ValueError): a fault fits no state of the machine
AssertionError
+-- ScriptError: a question came that the script of the expert does not expect
+-- TrialLimitError: a trial did not end in time
"""

from smach_oracle.oracle.errors import OracleError


class FaultError(OracleError, ValueError):
    """A fault, or a soak, does not fit the machine. The text says what there is."""


class ScriptError(AssertionError):
    """A question does not go with the script of the expert. The text shows both."""


class TrialLimitError(AssertionError):
    """A trial did not end in time. The text shows how far it came."""
