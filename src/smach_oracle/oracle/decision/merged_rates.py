"""Merges what two machines have learned of one state. Pure."""

from typing import Any, Dict, List, Mapping

Learned = Mapping[str, Any]  # the snapshot of an estimator


def base_of(learned: Learned) -> Dict[str, Any]:
    """Return what `merged` has to know of a snapshot, to tell later what is new since then."""
    return {
        key: learned[key]
        for key in ('estimator', 'successes', 'failures', 'rate')
        if key in learned
    }


def merged(own: Learned, base: Learned, theirs: Learned, memory: int) -> Dict[str, Any]:
    """Return what others have learned, and behind it what is new of our own since `base`.

    A failure that was taken back since then is taken out.

    :raises ValueError: where `theirs` is no snapshot.
    """
    try:
        return _merged(own, base, theirs, memory)
    except (TypeError, AttributeError, LookupError) as err:
        raise ValueError('{!r} is not what was learned of a state'.format(theirs)) from err


def _merged(own: Learned, base: Learned, theirs: Learned, memory: int) -> Dict[str, Any]:
    successes = own['successes'] - base.get('successes', 0)
    failures = own['failures'] - base.get('failures', 0)
    if base and base == base_of(theirs):
        return dict(own)
    result = dict(
        own,
        successes=max(0, int(theirs['successes']) + successes),
        failures=max(0, int(theirs['failures']) + failures),
    )
    if theirs['estimator'] != own['estimator']:
        return result
    new = max(0, successes) + max(0, failures)
    if 'window' in own:
        result['window'] = (
            _without(list(theirs['window']), -failures) + _latest(own['window'], new, failures)
        )[-memory:]
    else:
        left = (1.0 - 1.0 / memory) ** new
        rate = own['rate'] + left * (theirs['rate'] - base.get('rate', own['rate']))
        result['rate'] = min(1.0, max(0.0, rate))
    return result


def _latest(window: List[int], count: int, failures: int) -> List[int]:
    if failures < 0:
        return [0] * count
    return window[-count:] if count else []


def _without(window: List[int], failures: int) -> List[int]:
    """Return the results without the latest of these failures."""
    for _ in range(failures):
        if 1 in window:
            del window[len(window) - 1 - window[::-1].index(1)]
    return window
