"""The summaries of a bag's trials as text, and back. Pure.

What many trials share, such as the settings, is a text of its own, which the others name: it is
kept once, sent once, and read once.
"""

import hashlib
import json
from contextlib import suppress
from functools import lru_cache
from typing import Any, Callable, Dict, List, Mapping, NamedTuple, Sequence, Tuple

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
_texts: Dict[Tuple[int, int, FailureRule], Tuple['_Shared', 'SharedText']] = {}


class SharedText(NamedTuple):
    """A text that the texts of many bags name."""

    name: str
    text: str


class SummaryText(NamedTuple):
    """The summaries of one bag's trials, which do not name the bag."""

    text: str
    shared: Tuple[SharedText, ...]  # that it names


class _Shared(NamedTuple):
    """The fields that many trials share."""

    settings: Tuple[Tuple[str, Any], ...]
    origin: Tuple[Tuple[str, str], ...]
    rule: FailureRule


SharedBy = Callable[[str], _Shared]  # by name


def text_of(summaries: Sequence[TrialSummary]) -> SummaryText:
    """Return the text of some summaries that have no truth yet."""
    shared = [_text_of_shared(_Shared(each.settings, each.origin, each.rule)) for each in summaries]
    data = [_data_of(trial, part.name) for trial, part in zip(summaries, shared)]
    return SummaryText(_encode(data), tuple(set(shared)))


def shared_by(texts: Callable[[str], str]) -> SharedBy:
    """Return what reads shared texts. `texts`: by name. It may raise LookupError."""
    return lru_cache(maxsize=_MOST_TEXTS)(lambda name: _shared_in(texts(name)))


def summaries_in_all(texts: Mapping[str, str], shared: SharedBy) -> Dict[str, List[TrialSummary]]:
    """Return the summaries in some texts, by the path of the bag. To read all at once is quicker.

    A text that `text_of` did not make is left out, and one that names a text that is not there.
    """
    try:
        lists = json.loads('[{}]'.format(','.join(texts.values())))
        if len(lists) == len(texts):
            return {
                path: [_summary(each, (path,), shared) for each in found]
                for path, found in zip(texts, lists)
            }
    except _NO_TEXT:
        pass
    found = {}
    for path, text in texts.items():
        with suppress(*_NO_TEXT):
            found[path] = [_summary(each, (path,), shared) for each in json.loads(text)]
    return found


def _data_of(trial: TrialSummary, shared: str) -> List[Any]:
    data: List[Any] = list(trial)
    data[_ENDING], data[_BAGS] = trial.ending.value, None
    data[_SETTINGS], data[_ORIGIN], data[_RULE] = shared, None, None
    return data


def _summary(data: List[Any], bags: Tuple[str], shared: SharedBy) -> TrialSummary:
    data[_ENDING], data[_BAGS] = _ENDINGS[data[_ENDING]], bags
    data[_SETTINGS], data[_ORIGIN], data[_RULE] = shared(data[_SETTINGS])
    data[_FAILURES], data[_INPUTS] = _pairs(data[_FAILURES]), _pairs(data[_INPUTS])
    if data[_CAUSE] is not None:
        seed, task, kinds, details = data[_CAUSE]
        data[_CAUSE] = RecordedCause(seed, task, tuple(kinds), tuple(details))
    return TrialSummary._make(data)


def _text_of_shared(shared: _Shared) -> SharedText:
    """Return the text of what many trials share. The same objects are encoded once."""
    key = (id(shared.settings), id(shared.origin), shared.rule)
    known = _texts.get(key)
    if known is None:
        if len(_texts) == _MOST_TEXTS:
            _texts.clear()
        text = _encode(shared)
        name = hashlib.blake2b(text.encode(), digest_size=16).hexdigest()
        # it holds what is shared, so that none is another
        known = _texts[key] = shared, SharedText(name, text)
    return known[1]


def _shared_in(text: str) -> _Shared:
    settings, origin, (words, version) = json.loads(text)
    rule = FailureRule(None if words is None else tuple(words), version)
    return _Shared(_pairs(settings), _pairs(origin), rule)


def _pairs(data: List[List[Any]]) -> Tuple[Any, ...]:
    return tuple(map(tuple, data)) if data else ()
