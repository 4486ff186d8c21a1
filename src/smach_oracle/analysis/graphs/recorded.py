"""The graphs of recorded containers: by their structure, else by their transitions. Pure."""

from typing import Counter, Dict, Iterable, Set, Tuple

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


class SeenContainer:
    """A container as its events show it, where the bag has no structure."""

    def __init__(self) -> None:
        self._taken: Counter[Tuple[str, str, str]] = Counter()
        self._labels: Dict[str, None] = {}
        self.has_decisions = False
        self.ends: Set[str] = set()  # outcomes

    def add(self, event: Event) -> None:
        """Take an event of it."""
        if event.kind == EventKind.STATE_START:
            self._labels[event.state] = None
        elif event.kind == EventKind.TRANSITION:
            self._taken[(event.state, event.outcome, event.target)] += 1
        elif event.kind == EventKind.DECISION:
            self.has_decisions = True
        elif event.kind == EventKind.CONTAINER_END:
            self.ends.add(event.outcome)

    def graph(self, path: str) -> ContainerGraph:
        """Return its graph."""
        return structure_from_counts(
            path, list(self._labels), [(*edge, times, 0.0) for edge, times in self._taken.items()]
        )


def graph_from_events(path: str, events: Iterable[Event]) -> ContainerGraph:
    """Return a container as its transitions show it, where the bag has no structure."""
    seen = SeenContainer()
    for event in events:
        if event.path == path:
            seen.add(event)
    return seen.graph(path)
