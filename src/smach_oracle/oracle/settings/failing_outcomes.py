"""Decides which outcomes sound like a failure. Pure, and without smach."""

import re
from typing import Dict, Iterable, Pattern

DEFAULT_FAILING_OUTCOMES = ('aborted', 'failed', 'failure', 'error')
PREEMPTED = 'preempted'
_MOST_KNOWN = 1000  # names. A state may make up outcomes without end


def is_preempted(outcome: object) -> bool:
    """Whether an outcome is the one of a preempt. Outcomes need not be strings."""
    return isinstance(outcome, str) and outcome.lower() == PREEMPTED


class FailingNames:
    """Tells whether an outcome names a failure: one of the given words, whole or as a suffix.

    A suffix begins after `_`, `-` or a change to a capital: grasp_failed, Grasp-Error, graspFailed,
    IOError. Case is ignored otherwise. `preempted` is never a failure.
    """

    def __init__(self, words: Iterable[str] = DEFAULT_FAILING_OUTCOMES) -> None:
        self.words = tuple(words)
        self._whole = _pattern(r'(?:^|.*[_\-])(?:{})$', self.words, re.IGNORECASE | re.DOTALL)
        capitalised = tuple(
            word[:1].upper() + word[1:] for word in self.words if word[:1].isalpha()
        )
        self._camel = _pattern(r'.*[^\W_](?:{})$', capitalised, re.DOTALL)
        self._known: Dict[str, bool] = {}  # of names that were asked about

    def __contains__(self, outcome: object) -> bool:
        if not isinstance(outcome, str):
            return False
        known = self._known.get(outcome)
        if known is None:
            known = not is_preempted(outcome) and bool(
                self._whole.match(outcome) or self._camel.match(outcome)
            )
            if len(self._known) < _MOST_KNOWN:
                self._known[outcome] = known
        return known


def _pattern(form: str, words: Iterable[str], flags: int) -> Pattern[str]:
    alternatives = '|'.join(re.escape(word) for word in words)
    return re.compile(form.format(alternatives) if alternatives else r'(?!)', flags)
