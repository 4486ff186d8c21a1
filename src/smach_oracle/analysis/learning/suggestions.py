"""Preconditions that a record suggests, and those that never helped."""

import math
from typing import Dict, Iterable, List, Mapping, NamedTuple, Sequence, Tuple

from smach_oracle.oracle.decision.ways import BY_PERSON, WayKind, WayResult, parts_of

from .record import Counted, MachineRecord, counts_by_way
from .words import failure_in_words, in_words

LEVEL = 0.05  # of all comparisons of a record together
WOULD_SHOW = 0.3  # the chance to help of a precondition that would have been seen to help
_AGAIN = (WayKind.AGAIN.value, WayKind.WAIT.value)
_BACK = (WayKind.STEP_BACK.value, WayKind.START.value, WayKind.TOP.value)


class Suggestion(NamedTuple):
    """A state that runs before another one is entered again, since that cures a kind of failure."""

    state: str
    precondition: str
    failure: str
    back: Counted  # going on from there
    again: Counted  # entering the failed state again, at once or after a wait
    p_value: float


class Useless(NamedTuple):
    """A state whose preconditions never helped."""

    state: str
    preconditions: Sequence[str]
    results: int
    p_value: float


def fisher_exact(one: Counted, other: Counted) -> float:
    """Return the one-sided p-value of Fisher's exact test: that the first helps no more often.

    R. A. Fisher, J. R. Stat. Soc. 85, 1922. Each is how often it helped, of how many times.
    """
    (helped, known), (others, other_known) = one, other
    total = math.comb(known + other_known, helped + others)
    tail = sum(
        math.comb(known, count) * math.comb(other_known, helped + others - count)
        for count in range(helped, min(known, helped + others) + 1)
    )
    return float(tail / total)


def holm(p_values: Sequence[float], level: float = LEVEL) -> List[bool]:
    """Return which of several comparisons are significant (S. Holm, Scand. J. Stat. 6, 1979)."""
    found = [False] * len(p_values)
    for rank, place in enumerate(sorted(range(len(p_values)), key=p_values.__getitem__)):
        if p_values[place] > level / (len(p_values) - rank):
            break
        found[place] = True
    return found


def suggested(record: MachineRecord) -> List[Suggestion]:
    """Return the preconditions that the record suggests, the best one for each kind of failure.

    A state is suggested if going on from it has cured a kind of failure of another state more often
    than entering that one again.
    """
    compared = [each for state in record.results for each in _compared(record, state)]
    best: Dict[Tuple[str, str], Suggestion] = {}
    for each, is_significant in zip(compared, holm([each.p_value for each in compared])):
        key = each.state, each.failure
        if is_significant and (key not in best or each.p_value < best[key].p_value):
            best[key] = each
    return list(best.values())


def _compared(record: MachineRecord, state: str) -> List[Suggestion]:
    kinds: Dict[str, List[WayResult]] = {}
    for each in record.results[state]:
        if each.place != BY_PERSON:  # a person knows more than the kind of failure
            kinds.setdefault(each.failure, []).append(each)
    found = []
    for failure, results in kinds.items():
        again = _sum(counts_by_way(each for each in results if each.kind in _AGAIN).values())
        back = counts_by_way(each for each in results if each.kind in _BACK)
        for way, count in back.items() if again[1] else ():
            target = _target(way, state)
            if target not in record.preconditions.get(state, ()):
                p_value = fisher_exact(count, again)
                found.append(Suggestion(state, target, failure, count, again, p_value))
    return found


def _sum(counts: Iterable[Counted]) -> Counted:
    listed = list(counts)
    return sum(helped for helped, _ in listed), sum(known for _, known in listed)


def _target(way: str, state: str) -> str:
    """Return the state that a way goes on from, as a precondition of the failed one names it."""
    _, name = parts_of(way)
    if not name.startswith('/'):
        return name
    # a name without '/' would be one of the failed state's own container
    return name[1:] if '/' in name[1:] or '/' not in state else name


def useless(record: MachineRecord) -> List[Useless]:
    """Return the states whose preconditions were run, and have never helped."""
    found = []
    for state, names in record.preconditions.items():
        prepared = [
            each for each in record.results.get(state, ()) if each.kind == WayKind.PREPARE.value
        ]
        helped, known = _sum(counts_by_way(prepared).values())
        if known:
            p_value = 1.0 if helped else (1.0 - WOULD_SHOW) ** known
            found.append(Useless(state, names, known, p_value))
    return [
        each
        for each, is_significant in zip(found, holm([each.p_value for each in found]))
        if is_significant
    ]


def as_yaml(record: MachineRecord) -> List[str]:
    """Return the settings that the record suggests, and below them what may go."""
    lines = _suggested_lines(suggested(record), record.preconditions)
    found = useless(record)
    if found:
        lines.append('# These preconditions have never helped, and may go:')
        for each in found:
            names = ', '.join(each.preconditions)
            lines.append('#   {}: {}  (0 of {})'.format(each.state, names, each.results))
    return lines or ['# The record suggests no precondition, and no declared one is useless.']


def _suggested_lines(
    found: Sequence[Suggestion], declared: Mapping[str, Sequence[str]]
) -> List[str]:
    states: Dict[str, Dict[str, List[Suggestion]]] = {}
    for each in found:
        states.setdefault(each.state, {}).setdefault(each.precondition, []).append(each)
    lines = ['states:'] if states else []
    for state, preconditions in states.items():
        lines += ['  {}:'.format(_quoted(state)), '    preconditions:']
        lines += ['      - {}'.format(_quoted(name)) for name in declared.get(state, ())]
        for name, reasons in preconditions.items():
            lines.append('      - {}'.format(_quoted(name)))
            lines += ['        # {}'.format(_reason(each)) for each in reasons]
    return lines


def _reason(each: Suggestion) -> str:
    return '{}: {}, {}'.format(
        failure_in_words(each.failure),
        'from {} {} of {}'.format(each.precondition, *each.back),
        in_words(WayKind.AGAIN.value, each.again),
    )


def _quoted(name: str) -> str:
    """Return a name as YAML has it."""
    is_plain = name.replace('_', 'a').replace('/', 'a').isalnum() and not name[:1].isdigit()
    return name if is_plain else "'{}'".format(name.replace("'", "''"))
