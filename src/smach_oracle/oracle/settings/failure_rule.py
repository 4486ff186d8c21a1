"""The rule by which failures are told, and what the end of a machine means by it. Pure.

A trial's record names its rule, so that it is counted by that rule forever.
"""

from enum import Enum
from functools import lru_cache
from typing import Iterable, Mapping, NamedTuple, Optional, Sequence, Tuple

from .failing_outcomes import (
    FORMER_FAILING_OUTCOMES,
    NEGATIONS,
    FailingNames,
    is_preempted,
    name_text,
    sounds_like_success,
    words_of,
)

RULE = 'failure_rule'  # key in the data of TRIAL_START and RESUMED, and in rates files
BY_NAME_VERSION = 1  # grows when other names come to mean a failure, or a success
_BY_NAME, _LISTED = 'by_name', 'failing_outcomes'

# The last word of an end that went well, besides those of `sounds_like_success`. Public programs
# offer `complete` and `done` in five or more programs as the one way on next to failures. FlexBE's
# states have `finished` or `done` next to `failed`. `ok` says it in plain English. Words that only
# say that it is over (end, exit, quit, stop) are left out, and so are those of single projects.
_WELL = frozenset(('complete', 'done', 'finished', 'ok', 'okay', 'successfully'))
_NOT_SO = NEGATIONS.union(('almost', 'partly', 'partially'))


class EndMeaning(Enum):
    """The meaning of an outcome with which a whole machine ends."""

    SUCCESS = 'success'
    FAILURE = 'failure'
    PREEMPTED = 'preempted'
    UNKNOWN = 'other end'  # its name is neither like a success nor like a failure


class FailureRule(NamedTuple):
    """A rule by which failures are told.

    `words`: those of the setting `failing_outcomes`. None means by the words of the names.

    >>> [FailureRule().meaning(end).value for end in ('succeeded', 'all_done', 'lost', 'parked')]
    ['success', 'success', 'failure', 'other end']
    >>> [FailureRule(('parked',)).meaning(end).value for end in ('lost', 'parked')]
    ['success', 'failure']
    """

    words: Optional[Tuple[str, ...]] = None
    version: int = BY_NAME_VERSION

    @property
    def failing(self) -> FailingNames:
        """Return the names that are failures."""
        return _names_by(self.words)

    @property
    def is_of_later_version(self) -> bool:
        """Whether this version does not know it, and uses its own instead."""
        return self.words is None and self.version > BY_NAME_VERSION

    def meaning(self, end: object) -> EndMeaning:
        """Return what it means that a machine has ended in this outcome.

        By a list, each outcome that is not on it is a success. One that is not text goes by its
        text, as which it is recorded.
        """
        return _meaning_by(self.words, name_text(end))

    def unknown(self, ends: Iterable[object]) -> Tuple[str, ...]:
        """Return those of some ends whose names say neither success nor failure, sorted."""
        names = (end for end in ends if isinstance(end, str))
        return tuple(sorted(end for end in names if self.meaning(end) is EndMeaning.UNKNOWN))

    def as_data(self) -> Mapping[str, object]:
        """Return it as plain data."""
        if self.words is None:
            return {_BY_NAME: self.version}
        return {_LISTED: list(self.words)}

    def __str__(self) -> str:
        """Return it in words."""
        if self.words is None:
            return 'by name, version {}'.format(self.version)
        return 'by a list: {}'.format(', '.join(self.words) or 'nothing')


FORMER_RULE = FailureRule(FORMER_FAILING_OUTCOMES)  # of records that name none


def rule_in(data: object) -> Optional[FailureRule]:
    """Return the rule that a record names in its data, None where it names none that is known."""
    told = data.get(RULE) if isinstance(data, Mapping) else None
    if not isinstance(told, Mapping):
        return None
    version, words = told.get(_BY_NAME), told.get(_LISTED)
    if isinstance(version, int) and not isinstance(version, bool) and version >= 1:
        return FailureRule(None, version)
    if isinstance(words, (list, tuple)) and all(isinstance(word, str) for word in words):
        return FailureRule(tuple(words))
    return None


def rule_after(before: FailureRule, data: object) -> FailureRule:
    """Return the rule of a trial after one of its records: the one that it names, else `before`.

    The first one has `FORMER_RULE` before it. A trial that goes on may go on by another rule.
    """
    return rule_in(data) or before


@lru_cache(maxsize=100)
def _names_by(words: Optional[Tuple[str, ...]]) -> FailingNames:
    return FailingNames(words)


@lru_cache(maxsize=1000)
def _meaning_by(listed: Optional[Tuple[str, ...]], end: str) -> EndMeaning:
    if is_preempted(end):
        return EndMeaning.PREEMPTED
    if end in _names_by(listed):
        return EndMeaning.FAILURE
    if listed is not None:
        return EndMeaning.SUCCESS
    words = words_of(end)
    if words[-1:] == ['preempted'] or words[-2:] == ['pre', 'empted']:
        return EndMeaning.PREEMPTED
    return EndMeaning.SUCCESS if _went_well(end, words) else EndMeaning.UNKNOWN


def _went_well(end: str, words: Sequence[str]) -> bool:
    is_called_so = sounds_like_success(end) or (bool(words) and words[-1] in _WELL)
    failing = _names_by(None)
    return is_called_so and not any(word in _NOT_SO or word in failing for word in words)
