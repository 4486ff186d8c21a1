"""Errors of the executive.

    OracleError
    +-- ConfigError (also a ValueError): a setting is wrong; names the key, the value and what is allowed
    +-- AnswerError (also a ValueError): an expert's answer does not fit its question
    |     +-- InterfaceError: the interface that an expert chose cannot be used; says why
    +-- TrialError: the executive was used out of order
"""


class OracleError(Exception):
    """Root of all errors raised by smach_oracle."""


class ConfigError(OracleError, ValueError):
    """A setting is wrong; the text names the key, the value and what is allowed."""

    def __init__(self, key: str, value: object, allowed: str) -> None:
        super().__init__('{}: {!r} is not allowed; allowed: {}'.format(key, value, allowed))
        self.key = key
        self.value = value
        self.allowed = allowed


class AnswerError(OracleError, ValueError):
    """An expert's answer does not fit its question; the text says what would."""


class InterfaceError(AnswerError):
    """The interface that an expert chose cannot be used now; the text says why."""


class TrialError(OracleError):
    """The executive was used out of order."""
