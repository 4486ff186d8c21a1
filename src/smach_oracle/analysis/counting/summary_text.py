"""The summaries of a bag's trials as text, and back. Pure.

What many trials share, such as the settings, is a text of its own: it is read once for all of them.
"""

import json
from functools import lru_cache
from typing import Any, List, NamedTuple, Sequence, Tuple

from smach_oracle.oracle.settings.failure_rule import FailureRule

from ..bag_events import RecordedCause
from ..trial_counter import TrialEnding
from .trial_summary import TrialSummary

_ENDINGS = {each.value: each for each in TrialEnding}
_FAILURES, _INPUTS, _BAGS, _ENDING, _CAUSE, _SETTINGS, _ORIGIN, _RULE = map(
    TrialSummary._fields.index,
    ('failures_by_state', 'inputs', 'bags', 'ending', 'cause', 'settings', 'origin', 'rule'),
)
_encode = json.JSONEncoder(separators=(',', ':')).encode


class _Shared(NamedTuple):
    """The fields that many trials share."""

    settings: Tuple[Tuple[str, Any], ...]
    origin: Tuple[Tuple[str, str], ...]
    rule: FailureRule


def text_of(summaries: Sequence[TrialSummary]) -> str:
    """Return the text of some summaries that have no truth yet. It does not name their bags."""
    return _encode([_data_of(each) for each in summaries])


def summaries_in(text: str, path: str) -> List[TrialSummary]:
    """Return the summaries in a text that `text_of` made. `path`: of the bag that they are from."""
    return [_summary(each, path) for each in json.loads(text)]


def _data_of(trial: TrialSummary) -> List[Any]:
    data: List[Any] = list(trial)
    data[_ENDING], data[_BAGS] = trial.ending.value, None
    data[_SETTINGS] = _encode(_Shared(trial.settings, trial.origin, trial.rule))
    data[_ORIGIN] = data[_RULE] = None
    return data


def _summary(data: List[Any], path: str) -> TrialSummary:
    data[_ENDING], data[_BAGS] = _ENDINGS[data[_ENDING]], (path,)
    data[_SETTINGS], data[_ORIGIN], data[_RULE] = _shared(data[_SETTINGS])
    data[_FAILURES], data[_INPUTS] = _pairs(data[_FAILURES]), _pairs(data[_INPUTS])
    if data[_CAUSE] is not None:
        seed, task, kinds, details = data[_CAUSE]
        data[_CAUSE] = RecordedCause(seed, task, tuple(kinds), tuple(details))
    return TrialSummary._make(data)


@lru_cache(maxsize=100)
def _shared(text: str) -> _Shared:
    settings, origin, (words, version) = json.loads(text)
    rule = FailureRule(None if words is None else tuple(words), version)
    return _Shared(_pairs(settings), _pairs(origin), rule)


def _pairs(data: List[List[Any]]) -> Tuple[Any, ...]:
    return tuple(map(tuple, data)) if data else ()
