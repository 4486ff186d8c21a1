"""Decides which outcomes sound like a failure. Pure, and without smach."""

import re
from functools import lru_cache
from typing import Callable, Iterable, List, Optional, Pattern, Tuple, cast

PREEMPTED = 'preempted'
# the rule of earlier versions, by which their trials are counted. These come first of several
FORMER_FAILING_OUTCOMES = ('aborted', 'failed', 'failure', 'error')
_MOST_KNOWN = 1000  # names. A state may make up outcomes without end

# what public programs call a failure, see doc/executive.md
_FAILURES = frozenset(
    FORMER_FAILING_OUTCOMES + ('fail', 'abort', 'timeout', 'timedout', 'unreachable', 'lost')
)
_SUCCESSES = frozenset(('succeeded', 'successful', 'success', 'completed'))
NEGATIONS = frozenset(('no', 'not', 'non', 'never', 'without'))
# what follows the word where a failure is over, or was provided for: failed_over, error_cleared
_SETTLED = frozenset(
    ('over', 'safe', 'free', 'cleared', 'handled', 'recovered', 'resolved', 'fixed', 'ok')
)
_WORDS = re.compile(r'[A-Z]+(?![a-z])|[A-Z]?[a-z]+|[^\W\d_A-Za-z]+')


def name_text(name: object) -> str:
    """Return an outcome or a label as records, settings and answers have it: by its text."""
    return name if isinstance(name, str) else str(name)


def is_preempted(outcome: object) -> bool:
    """Whether an outcome is the one of a preempt. Outcomes need not be strings."""
    return isinstance(outcome, str) and outcome.lower() == PREEMPTED


class FailingNames:
    """Tells whether an outcome names a failure, by its own words or by those that a user has given.

    `by_name`: whether their own words count. `first`: names that come first where a container has
    several such outcomes.

    >>> by_name = FailingNames()
    >>> [name in by_name for name in ('graspFailed', 'LOST_LINE', 'timed_out', 'not_completed')]
    [True, True, True, True]
    >>> [name in by_name for name in ('no_error', 'failed_over', 'preempted', 'blackboard')]
    [False, False, False, False]
    >>> 'lost_line' in FailingNames(['lost']), 'line_lost' in FailingNames(['lost'])
    (False, True)

    By its own words: it begins or ends with a word of failure, and none of its words turns that
    around. It is also a failure if it says that something has not succeeded. A word begins after
    what is no letter, and with a capital. Numbers do not count.

    By words of a user: it is one of them, or ends with one after `_`, `-` or a change to a capital.
    Case does not matter otherwise. `preempted` is never a failure.
    """

    def __init__(self, words: Optional[Iterable[str]] = None) -> None:
        """`words`: those that a user has given. None means that the names' own words count."""
        self.by_name = words is None
        self.first = FORMER_FAILING_OUTCOMES if words is None else tuple(words)
        self._names_failure: Callable[[str], bool] = (
            _sounds_failing if words is None else lru_cache(_MOST_KNOWN)(_ends_with(self.first))
        )

    def __contains__(self, outcome: object) -> bool:
        if self.by_name and not isinstance(outcome, str):
            return False
        return self._names_failure(name_text(outcome))

    def __reduce__(self) -> Tuple[object, ...]:
        """Return how a copied or pickled one is made: by its words."""
        return type(self), (None if self.by_name else self.first,)

    def excuse(self, outcome: object) -> bool:
        """Whether an outcome is no failure of its state although it ends the container in one."""
        is_named = self.by_name and isinstance(outcome, str)
        return is_named and (is_preempted(outcome) or sounds_like_success(cast('str', outcome)))


@lru_cache(_MOST_KNOWN)
def sounds_like_success(outcome: str) -> bool:
    """Whether an outcome is called a success: that is no failure wherever its author leads it."""
    words = words_of(outcome)
    return bool(words) and words[-1] in _SUCCESSES and not NEGATIONS.intersection(words)


@lru_cache(_MOST_KNOWN)
def _sounds_failing(outcome: str) -> bool:
    words = words_of(outcome)
    if not words:
        return False
    if 'unsuccessful' in words or 'unsucceeded' in words:
        return True
    if NEGATIONS.intersection(words):
        return words[-1] in _SUCCESSES and words[-2] in NEGATIONS
    return words[-1] in _FAILURES or (words[0] in _FAILURES and words[-1] not in _SETTLED)


def words_of(outcome: str) -> List[str]:
    """Return the words of a name in lower case, with `time out` and `timed out` as one."""
    words: List[str] = []
    for word in _WORDS.findall(outcome):
        word = word.lower()
        if word == 'out' and words and words[-1] in ('time', 'timed'):
            words[-1] = 'timeout'
        else:
            words.append(word)
    return words


def _ends_with(words: Iterable[str]) -> Callable[[str], bool]:
    whole = _pattern(r'(?:^|.*[_\-])(?:{})$', words, re.IGNORECASE | re.DOTALL)
    capitalised = tuple(word[:1].upper() + word[1:] for word in words if word[:1].isalpha())
    camel = _pattern(r'.*[^\W_](?:{})$', capitalised, re.DOTALL)
    return lambda outcome: (
        not is_preempted(outcome) and bool(whole.match(outcome) or camel.match(outcome))
    )


def _pattern(form: str, words: Iterable[str], flags: int) -> Pattern[str]:
    alternatives = '|'.join(re.escape(word) for word in words)
    return re.compile(form.format(alternatives) if alternatives else r'(?!)', flags)
