"""Counts of the transitions and the jumps that were taken. Pure."""

from collections import Counter
from typing import Dict, Iterable, Mapping, NamedTuple

from smach_oracle.oracle.records.events import Event, EventKind
from smach_oracle.oracle.records.facts import JUMPED_TO

from ..graphs.container_graph import GraphEdge
from ..replaying.followed import is_act_of_person, left_by


class Transition(NamedTuple):
    """A transition of a container."""

    path: str
    edge: GraphEdge


class TakenJump(NamedTuple):
    """A way from a state to another one that its author has not drawn."""

    state: str  # path
    target: str  # path
    by_person: bool


class Taken(NamedTuple):
    """Counts of transitions and of jumps."""

    transitions: Dict[Transition, int]
    jumps: Dict[TakenJump, int]


def nothing_taken() -> Taken:
    """Return counts to which those of trials are added."""
    return Taken(Counter(), Counter())


def add_taken(taken: Taken, events: Iterable[Event]) -> None:
    """Count those of a trial."""
    for event in events:
        if event.kind == EventKind.TRANSITION and event.outcome:
            edge = GraphEdge(event.state, event.outcome, event.target)
            taken.transitions[Transition(event.path, edge)] += 1
        elif event.kind == EventKind.JUMP:
            data: Mapping[str, object] = event.data if isinstance(event.data, Mapping) else {}
            target = str(data.get(JUMPED_TO, '')) or '/'.join((event.path, event.target))
            taken.jumps[TakenJump('/'.join(left_by(event)), target, is_act_of_person(event))] += 1
