"""Errors of the executive. The docstring of the package draws those of the other rooms.

Their tree::

    OracleError
    +-- SettingsError (also a ValueError): a setting is wrong
    +-- AnswerError (also a ValueError): an expert's answer does not fit its question
    |     +-- InterfaceError: the interface that an expert chose cannot be used
    +-- OperatorError (also a ValueError): an operator's command cannot be obeyed
    +-- CheckpointError: the store of a machine cannot be used
    +-- LabelError (also a TypeError): a state of a machine has a label that is not text
    +-- TrialError: the executive was used out of order
    +-- TooDeepError (also a RecursionError): too many containers lie in each other
"""

import warnings


class OracleError(Exception):
    """The root of the errors of the executive, and of most others of the package."""


class SettingsError(OracleError, ValueError):
    """A setting is wrong. The text names the key, the value and what is allowed, or is `text`.

    `problem` stands after the value and says what is wrong with it.
    """

    def __init__(
        self, key: str, value: object, allowed: str, text: str = '', problem: str = 'is not allowed'
    ) -> None:
        super().__init__(text or '{}: {!r} {}; allowed: {}'.format(key, value, problem, allowed))
        self.key = key
        self.value = value
        self.allowed = allowed
        self._text = text
        self._problem = problem

    def set_at(self, origin: str) -> 'SettingsError':
        """Return the same error with the file, line or parameter that set the key before it."""
        text = '{}: {}'.format(origin, self._text) if self._text else ''
        return SettingsError(
            '{}: {}'.format(origin, self.key), self.value, self.allowed, text, self._problem
        )

    def called(self, key: str) -> 'SettingsError':
        """Return the same error about a key under another name."""
        return SettingsError(key, self.value, self.allowed, self._text, self._problem)

    def allowing(self, more: str) -> 'SettingsError':
        """Return the same error with more that is allowed."""
        return SettingsError(self.key, self.value, self.allowed + more, self._text, self._problem)


class AnswerError(OracleError, ValueError):
    """An expert's answer does not fit its question. The text says what would."""


class OperatorError(OracleError, ValueError):
    """An operator's command cannot be obeyed. The text says why, and what is allowed."""


class InterfaceError(AnswerError):
    """The interface that an expert chose cannot be used now. The text says why."""


class CheckpointError(OracleError):
    """The store that the setting `checkpoint` names cannot be used. The text says which and why.

    Nothing of the machine has run.
    """


class LabelError(OracleError, TypeError):
    """A state of a machine has a label that is not text, so that no setting or event can name it.

    SMACH executes such a machine. An oracle does not.
    """


class TrialError(OracleError):
    """The executive was used out of order."""


class TooDeepError(OracleError, RecursionError):
    """Too many containers lie in each other for Python's stack. The text says what to do.

    It is no failure of a state: no oracle recovers from it.
    """


def __getattr__(name: str) -> type:
    """Give the class that had another name under its old one, with a warning."""
    if name != 'ConfigError':
        raise AttributeError('module {!r} has no attribute {!r}'.format(__name__, name))
    warnings.warn(
        'smach_oracle.oracle.errors.ConfigError is now called SettingsError',
        FutureWarning,
        stacklevel=2,
    )
    return SettingsError
