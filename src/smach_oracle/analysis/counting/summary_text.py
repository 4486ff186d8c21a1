"""The summaries of a bag's trials as text, and back. Pure.

What many trials share, such as the settings, is a text of its own: it is read once for all of them.
"""

import json
from contextlib import suppress
from functools import lru_cache
from typing import Any, Dict, List, Mapping, NamedTuple, Sequence, Tuple

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


_MOST_TEXTS = 100
_NO_TEXT = (LookupError, TypeError, ValueError)  # what another text raises
# by the identity of settings and origin, and by the rule
_texts: Dict[Tuple[int, int, FailureRule], Tuple['_Shared', str]] = {}


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


def summaries_in_all(texts: Mapping[str, str]) -> Dict[str, List[TrialSummary]]:
    """Return the summaries in some texts, by the path of the bag. To read all at once is quicker.

    A text that `text_of` did not make is left out.
    """
    try:
        lists = json.loads('[{}]'.format(','.join(texts.values())))
        if len(lists) == len(texts):
            return {
                path: [_summary(each, path) for each in found] for path, found in zip(texts, lists)
            }
    except _NO_TEXT:
        pass
    found = {}
    for path, text in texts.items():
        with suppress(*_NO_TEXT):
            found[path] = summaries_in(text, path)
    return found


def _data_of(trial: TrialSummary) -> List[Any]:
    data: List[Any] = list(trial)
    data[_ENDING], data[_BAGS] = trial.ending.value, None
    data[_SETTINGS] = _text_of_shared(_Shared(trial.settings, trial.origin, trial.rule))
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


def _text_of_shared(shared: _Shared) -> str:
    """Return the text of what many trials share. The same objects are encoded once."""
    key = (id(shared.settings), id(shared.origin), shared.rule)
    known = _texts.get(key)
    if known is None:
        if len(_texts) == _MOST_TEXTS:
            _texts.clear()
        known = _texts[key] = shared, _encode(shared)  # it holds them, so that none is another
    return known[1]


@lru_cache(maxsize=100)
def _shared(text: str) -> _Shared:
    settings, origin, (words, version) = json.loads(text)
    rule = FailureRule(None if words is None else tuple(words), version)
    return _Shared(_pairs(settings), _pairs(origin), rule)


def _pairs(data: List[List[Any]]) -> Tuple[Any, ...]:
    return tuple(map(tuple, data)) if data else ()
