"""The graphs of recorded containers: by their structure, else by their transitions. Pure."""

from typing import Counter, Dict, Iterable, Tuple

from smach_oracle.oracle.records.events import Event, EventKind

from ..bag_machines import RecordedMachines
from .container_graph import ContainerGraph, GraphEdge, make_structure, structure_from_counts


def recorded_graphs(machines: RecordedMachines) -> Dict[str, ContainerGraph]:
    """Return the containers whose structures are recorded, by path."""
    return {
        path: make_structure(
            path, graph.children, [GraphEdge(*edge) for edge in graph.edges], graph.outcomes
        )
        for path, graph in machines.containers.items()
    }


def graph_from_events(path: str, events: Iterable[Event]) -> ContainerGraph:
    """Return a container as its transitions show it, where the bag has no structure."""
    taken: Counter[Tuple[str, str, str]] = Counter()
    labels: Dict[str, None] = {}
    for event in events:
        if event.path == path and event.kind == EventKind.STATE_START:
            labels[event.state] = None
        elif event.path == path and event.kind == EventKind.TRANSITION:
            taken[(event.state, event.outcome, event.target)] += 1
    return structure_from_counts(
        path, list(labels), [[*edge, times, 0.0] for edge, times in taken.items()]
    )
