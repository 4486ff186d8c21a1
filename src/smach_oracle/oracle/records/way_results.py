"""Results of the ways that were gone on from failures. Pure, and without smach.

A way *helped* if the next result of the failed state in this trial is a success. It did not if the
state fails again in any kind, or if the trial ends in failure first. Nobody knows after a preempt,
a shutdown or the act of a person.
"""

import math
import re
from collections import deque
from functools import lru_cache
from typing import Any, Callable, Deque, Dict, Iterable, List, Mapping, Optional, Tuple

from ..decision.ways import PLACES, Count, WayResult
from ..number_checks import is_whole
from .events import FailureKind
from .short_text import shortened

MOST_RESULTS = 120  # that are kept of a state, the latest ones
MOST_FAILURES = 8  # kinds of failure with a text of their own, among these
WAYS, WAYS_TOTAL = 'ways', 'ways_total'  # keys of what was learned of a state

_HELPED = {True: '1', False: '0', None: '-'}
_READ = {told: helped for helped, told in _HELPED.items()}
_KINDS = {int(each): each.name.lower() for each in FailureKind}
_LONGEST = 120
_LONGEST_READ = 2000
_NUMBER = re.compile(r'(?:(?<!\w)[-+])?(?:0x[0-9a-f]+|\d+(?:\.\d+)?(?:e[-+]?\d+)?)', re.IGNORECASE)


@lru_cache(maxsize=32)  # a state fails with the same text again and again
def failure_text_key(kind: int, outcome: str, text: str) -> str:
    """Return the name of a kind of failure: its FailureKind, its outcome, and its text.

    A text with other numbers in it is the same. A long one lacks its middle.

    >>> failure_text_key(1, 'aborted', 'no object within 0.25 m (try 3)')
    'failing_outcome aborted: no object within # m (try #)'
    """
    words = [_KINDS.get(kind, str(kind)), outcome]
    plain = ' '.join(_NUMBER.sub('#', shortened(text, _LONGEST_READ)).split())
    return shortened(': '.join(filter(None, (' '.join(filter(None, words)), plain))), _LONGEST)


def plain_failure_key(key: str) -> str:
    """Return the name of a kind of failure without its text."""
    return key.partition(':')[0]


class WayLog:
    """The results of the ways on from one state.

    `total`: how many results there were in all. `gone`: the way that is gone now. `of_kinds`: how
    often ways of a kind at a place have helped, and how often not.
    """

    def __init__(self) -> None:
        self.results: Deque[WayResult] = deque(maxlen=MOST_RESULTS)
        self.total = 0
        self.of_kinds: Dict[Tuple[str, int], Count] = {}
        self._failures: Dict[str, int] = {}  # results by kind of failure, of those with a text
        self.gone: Optional[WayResult] = None
        self._told: Optional[Dict[str, object]] = None  # until there is one more
        self._minutes: Callable[[], float] = float

    def failure_key(self, kind: int, outcome: str, text: str) -> str:
        """Return the name of a kind of failure. It has no text where enough others have one."""
        key = failure_text_key(kind, outcome, text)
        known = self._failures
        return key if key in known or len(known) < MOST_FAILURES else plain_failure_key(key)

    def go(self, gone: WayResult, minutes: Callable[[], float]) -> None:
        """Note that a way is gone from now on. `minutes`: since it was chosen, later on."""
        self.settle(None)
        self.gone, self._minutes = gone, minutes

    def settle(self, helped: Optional[bool]) -> None:
        """Note the result of the way that is gone, where one is. None: nobody knows it."""
        if self.gone is not None:
            result = self.gone._replace(helped=helped, minutes=round(self._minutes(), 3))
            self.gone, self._minutes = None, float
            self._add(result)
            self.total += 1
            self._told = None

    def _add(self, result: WayResult) -> None:
        """Have one result more, and the oldest one no more where there are too many."""
        if len(self.results) == MOST_RESULTS:
            self._count(self.results[0], -1)
        self.results.append(result)
        self._count(result, 1)

    def _count(self, result: WayResult, by: int) -> None:
        """Count a result, or take it out: a decision asks for the counts of all states."""
        if ':' in result.failure:
            self._failures[result.failure] = self._failures.get(result.failure, 0) + by
            if not self._failures[result.failure]:
                del self._failures[result.failure]
        if result.helped is not None:
            kind = result.kind, result.place
            helped, not_helped = self.of_kinds.get(kind, (0.0, 0.0))
            count = helped + by * result.helped, not_helped + by * (not result.helped)
            self.of_kinds[kind] = count
            if count == (0.0, 0.0):
                del self.of_kinds[kind]

    def twin(self) -> 'WayLog':
        """Return the results alone, without the way that is gone now."""
        twin = WayLog()
        twin.hold(self.results, self.total)
        return twin

    def hold(self, results: Iterable[WayResult], total: int) -> None:
        """Have these results alone. `total`: how many there were in all."""
        self.results.clear()
        self.of_kinds, self._failures = {}, {}
        for each in results:
            self._add(each)
        self.total = total
        self._told = None

    def told(self) -> Dict[str, object]:
        """Return the results as plain data, nothing where there is none. See `results_in`."""
        if not self.results:
            return {}
        if self._told is None:
            self._told = told_of(self.results, self.total)
        return self._told

    def take_over(self, learned: Mapping[str, object]) -> None:
        """Go on with the results that are among what was learned of a state.

        :raises ValueError: where they cannot be read.
        """
        self.hold(*results_in(learned))


def told_of(results: Iterable[WayResult], total: int) -> Dict[str, Any]:
    """Return results as plain data: each way and kind of failure by its place in a list.

    A result is a short text: the numbers of these two around its place, `1`, `0` or `-` for
    whether it helped, the minutes, and the hope, where there is one.
    """
    ways: Dict[Tuple[str, str], int] = {}
    failures: Dict[str, int] = {}
    rows: List[str] = []
    for each in results:
        way = ways.setdefault((each.way, each.kind), len(ways))
        failure = failures.setdefault(each.failure, len(failures))
        row = [way, each.place, failure, _HELPED[each.helped], '{:g}'.format(each.minutes)]
        rows.append(' '.join(map(str, row if each.hoped is None else [*row, each.hoped])))
    names = [list(each) for each in ways]
    return {WAYS: {'names': names, 'failures': list(failures), 'results': rows}, WAYS_TOTAL: total}


def results_in(learned: Mapping[str, Any]) -> Tuple[List[WayResult], int]:
    """Return the results that are among what was learned of a state, and how many there were.

    :raises ValueError: where they cannot be read.
    """
    if WAYS not in learned:
        return [], 0
    try:
        told, total = learned[WAYS], int(learned[WAYS_TOTAL])
        names, failures = told['names'], list(map(str, told['failures']))
        results = [_result(row, names, failures) for row in told['results']][-MOST_RESULTS:]
    except (AttributeError, LookupError, OverflowError, TypeError, ValueError) as err:
        raise ValueError('{}: cannot be read as results of ways: {}'.format(WAYS, err)) from err
    return results, max(total, len(results))


def _result(row: str, names: List[List[str]], failures: List[str]) -> WayResult:
    way, place, failure, helped, minutes, *hoped = row.split(' ')
    key, kind = names[_index(way)]
    result = WayResult(
        str(key),
        str(kind),
        int(place),
        failures[_index(failure)],
        _READ[helped],
        float(minutes),
        float(hoped[0]) if hoped else None,
    )
    is_sound = 0.0 <= result.minutes < math.inf and 0.0 <= (result.hoped or 0.0) <= 1.0
    if result.place not in PLACES or not is_sound:
        raise ValueError('{!r} is no result'.format(row))
    return result


def _index(text: str) -> int:
    if int(text) < 0:
        raise ValueError('{} is no number of a list'.format(text))
    return int(text)


def merged_ways(
    own: Mapping[str, object], base: Mapping[str, Any], theirs: Mapping[str, object]
) -> Dict[str, object]:
    """Return the results of others, and behind them what is new of our own since `base`.

    Where others have none, a program of an earlier version may have dropped them: ours stay.

    :raises ValueError: where they cannot be read.
    """
    told = {key: own[key] for key in (WAYS, WAYS_TOTAL) if key in own}
    if WAYS not in theirs:
        return told
    is_new = own.get(WAYS_TOTAL) != base.get(WAYS_TOTAL)
    if told and not is_new and all(theirs.get(key) == each for key, each in told.items()):
        return told  # as of most states, if one has failed: there is nothing to read
    (ours, total), (others, other_total) = results_in(own), results_in(theirs)
    before = base.get(WAYS_TOTAL, 0)  # a file that had no results may have had anything here
    new = max(0, total - (before if is_whole(before, 0) else 0))
    results = deque([*others, *ours[len(ours) - min(new, len(ours)) :]], MOST_RESULTS)
    return told_of(results, other_total + new) if results else {}


def counts_of_kinds(
    logs: Iterable[Mapping[Tuple[str, int], Count]],
) -> Dict[Tuple[str, int], Count]:
    """Return the sum of what the logs of several states have as their `of_kinds`."""
    counts: Dict[Tuple[str, int], Count] = {}
    for each in logs:
        for kind, (helped, not_helped) in each.items():
            before = counts.get(kind, (0.0, 0.0))
            counts[kind] = before[0] + helped, before[1] + not_helped
    return counts
