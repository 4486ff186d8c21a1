"""Says in words what ways have led to."""

from typing import Dict, List, Sequence

from smach_oracle.oracle.decision.ways import BY_PERSON, WayKind, WayResult, parts_of

from .record import Counted, counts_by_way


def explained(state: str, results: Sequence[WayResult]) -> List[str]:
    """Return a line for each kind of failure of a state, the most frequent one first."""
    kinds: Dict[str, List[WayResult]] = {}
    for each in results:
        kinds.setdefault(each.failure, []).append(each)
    lines = []
    for failure, of_kind in sorted(kinds.items(), key=lambda item: -len(item[1])):
        own = [each for each in of_kind if each.place != BY_PERSON]
        chosen = [each for each in of_kind if each.place == BY_PERSON]
        told = [in_words(way, count) for way, count in counts_by_way(own).items()]
        told += [
            in_words(way, count) + ' by a person' for way, count in counts_by_way(chosen).items()
        ]
        unknown = sum(each.helped is None for each in of_kind)
        told += ['{} with an unknown result'.format(unknown)] if unknown else []
        lines.append('{}, {}: {}'.format(state, failure_in_words(failure), ', '.join(told)))
    return lines


def in_words(way: str, count: Counted) -> str:
    """Return how often a way has helped."""
    return '{} {} of {}'.format(way_in_words(way), *count)


def way_in_words(way: str) -> str:
    """Return what is done by a way."""
    kind, what = parts_of(way)
    return {
        WayKind.AGAIN: 'entering again',
        WayKind.PREPARE: 'after its preconditions',
        WayKind.WAIT: 'after ' + what,
    }.get(kind or WayKind.STEP_BACK, way)


def failure_in_words(failure: str) -> str:
    """Return the text of a kind of failure in quotation marks, or its outcome where it has none."""
    kind, _, text = failure.partition(': ')
    return "'{}'".format(text) if text else kind.partition(' ')[2] or kind.replace('_', ' ')
