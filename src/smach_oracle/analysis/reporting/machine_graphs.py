"""Graphs of containers, coloured by how often states failed, with counts at the transitions.

Colours go from green to red and from light to dark, and each box says its numbers: nothing is told
by the hue alone.
"""

import math
from typing import Dict, Iterable, List, Mapping, NamedTuple, Optional, Sequence, Tuple

from smach_oracle.oracle.records.events import Event
from smach_oracle.oracle.records.short_text import shortened

from ..bag_machines import read_machines
from ..by_state.state_counts import StatesOfTrials
from ..counting.trial_summary import TrialSummary
from ..graphs.container_graph import ContainerGraph, GraphEdge, GraphLayout, dot_text
from ..graphs.dot import LayoutError, lay_out
from ..graphs.recorded import SeenContainer, recorded_graphs
from .taken import Taken

MOST_GRAPHS = 30  # containers of a machine
_TRIED = 5  # bags that are looked into for the structure of a machine
_NAME, _EDGE_NAME = 28, 20  # letters that are shown
_MARGIN = 8.0
_ARROW = 4.0  # half the width of its head
_THIN, _THICK = 1.0, 5.0  # of a transition
_GREEN = 130  # hue of a state that never fails, as on the console
Point = Tuple[float, float]


class StateShape(NamedTuple):
    """A state's box. Lengths are in pixels, x and y of its centre."""

    x: float
    y: float
    width: float
    height: float
    label: str
    name: str  # the label in full
    numbers: str  # in words
    colour: str
    is_visited: bool
    is_container: bool


class OutcomeShape(NamedTuple):
    """An outcome of the container."""

    x: float
    y: float
    width: float
    height: float
    label: str
    name: str


class EdgeShape(NamedTuple):
    """A transition that is drawn."""

    line: str
    head: str  # the arrow's
    x: float  # of its label
    y: float
    label: str
    name: str  # in full
    thickness: float
    taken: int  # times


class ContainerDrawing(NamedTuple):
    """The graph of a container. Without a layout it has no shapes, and is a table."""

    path: str
    width: float
    height: float
    states: List[StateShape]
    outcomes: List[OutcomeShape]
    edges: List[EdgeShape]
    rows: List[Tuple[str, str, str, int]]  # state, outcome, target, times
    problem: str  # why it is not drawn


class SeenContainers:
    """The containers that ran in some trials, by path."""

    def __init__(self) -> None:
        self.by_path: Dict[str, SeenContainer] = {}

    def add(self, events: Iterable[Event]) -> None:
        """Take the events of a trial."""
        for event in events:
            if event.path:
                self.by_path.setdefault(event.path, SeenContainer()).add(event)


def graphs_of(trials: Sequence[TrialSummary], seen: SeenContainers) -> List[ContainerGraph]:
    """Return the graphs of the containers that ran, the top machine first.

    The latest bag that has structures tells them, else the transitions in the events.
    """
    known: Dict[str, ContainerGraph] = {}
    for path in list(dict.fromkeys(bag for trial in reversed(trials) for bag in trial.bags))[
        :_TRIED
    ]:
        known = _structures(path)
        if known:
            break
    paths = sorted(seen.by_path)[:MOST_GRAPHS]
    return [known.get(path) or _without_oracle(path, seen.by_path[path]) for path in paths]


def _without_oracle(path: str, seen: SeenContainer) -> ContainerGraph:
    """Return a graph of transitions without the meta state, which looks like an outcome there.

    A container with decisions ends in each of its outcomes, and never in the meta state.
    """
    graph = seen.graph(path)
    if not seen.has_decisions:
        return graph
    edges = tuple(
        edge for edge in graph.edges if edge.target in graph.states or edge.target in seen.ends
    )
    outcomes = tuple(outcome for outcome in graph.outcomes if outcome in seen.ends)
    return graph._replace(outcomes=outcomes, edges=edges)


def _structures(bag: str) -> Dict[str, ContainerGraph]:
    try:
        return recorded_graphs(read_machines(bag))
    except Exception:  # a damaged bag can make rosbags raise anything: the events tell the graph
        return {}


class Drawer:
    """Draws containers. It lays each one out once, however many variants ran it."""

    def __init__(self, command: str = 'dot') -> None:
        self._command = command
        self._layouts: Dict[str, GraphLayout] = {}
        self.problem = ''  # why the latest layout failed

    def draw(
        self, graph: ContainerGraph, taken: Taken, states: StatesOfTrials, containers: Sequence[str]
    ) -> ContainerDrawing:
        """Draw one container.

        :param taken: by the trials of a variant.
        :param states: what happened in them.
        :param containers: paths of all containers.
        """
        counts = {
            each.edge: number
            for each, number in taken.transitions.items()
            if each.path == graph.path
        }
        whole = _with_taken(graph, counts)
        rows = [(*edge, counts.get(edge, 0)) for edge in whole.edges]
        rows += [
            (*edge, number) for edge, number in sorted(counts.items()) if edge not in whole.edges
        ]
        layout = self._layout(whole)
        if layout is None:
            return ContainerDrawing(graph.path, 0.0, 0.0, [], [], [], rows, self.problem)
        names = {label: 'n{}'.format(at) for at, label in enumerate(whole.states + whole.outcomes)}
        return ContainerDrawing(
            graph.path,
            round(layout.width + 2 * _MARGIN, 1),
            round(layout.height + 2 * _MARGIN, 1),
            [
                _state(whole.path, label, layout.nodes[names[label]], states, containers)
                for label in whole.states
                if names[label] in layout.nodes
            ],
            [
                OutcomeShape(
                    *_moved(layout.nodes[names[label]]),
                    shortened(label, _NAME),
                    _title(label, whole.bundled.get(label, 0)),
                )
                for label in whole.outcomes
                if names[label] in layout.nodes
            ],
            _edges(whole, layout, counts),
            rows,
            '',
        )

    def _layout(self, graph: ContainerGraph) -> Optional[GraphLayout]:
        if not graph.is_small:
            self.problem = '{} has {} states, more than can be read in a drawing'.format(
                graph.path, len(graph.states)
            )
            return None
        text = dot_text(graph)
        if text not in self._layouts:
            try:
                self._layouts[text] = lay_out(text, self._command)
            except LayoutError as err:
                self.problem = str(err)
                return None
        return self._layouts[text]


def _with_taken(graph: ContainerGraph, counts: Mapping[GraphEdge, int]) -> ContainerGraph:
    """Return the graph with the transitions that were taken, and that its structure lacks.

    An outcome that falls through to the container's own has none there.
    """
    places = set(graph.states) | set(graph.outcomes)
    more = sorted(
        edge
        for edge in counts
        if edge not in graph.edges and edge.source in graph.states and edge.target in places
    )
    return graph._replace(edges=graph.edges + tuple(more))


def _title(outcome: str, bundled: int) -> str:
    """Return the title of an outcome. `bundled`: the preemptions that lead there undrawn."""
    return '{}, by preemption from {} states'.format(outcome, bundled) if bundled else outcome


def _moved(place: Tuple[float, float, float, float]) -> Tuple[float, float, float, float]:
    x, y, width, height = (round(each, 1) for each in place)
    return x + _MARGIN, y + _MARGIN, width, height


def _state(
    path: str,
    label: str,
    place: Tuple[float, float, float, float],
    states: StatesOfTrials,
    containers: Sequence[str],
) -> StateShape:
    name = '/'.join((path, label))
    counts = states.states.get(name)
    visits, failures = (counts.visits, counts.failures) if counts else (0, 0)
    rate = min(1.0, failures / visits) if visits else 0.0
    numbers = 'never visited'
    if visits or failures:
        numbers = '{}/{} failed, {:.0%}'.format(failures, visits, rate)
    return StateShape(
        *_moved(place),
        shortened(label, _NAME),
        label,
        numbers,
        colour_of(rate) if visits else '#ffffff',
        visits > 0,
        name in containers,
    )


def colour_of(rate: float) -> str:
    """Return the colour of a failure rate: from light green to a darker red."""
    inside = min(1.0, max(0.0, rate))
    return 'hsl({:.0f} {:.0f}% {:.0f}%)'.format(
        _GREEN * (1.0 - inside), 55 + 20 * inside, 90 - 26 * math.sqrt(inside)
    )


def _edges(
    graph: ContainerGraph, layout: GraphLayout, counts: Mapping[GraphEdge, int]
) -> List[EdgeShape]:
    most = max([1, *counts.values()])
    shapes = []
    for at, edge in enumerate(graph.edges):
        points, label = layout.edges.get('e{}'.format(at), ([], None))
        if len(points) < 2:
            continue
        moved = [(x + _MARGIN, y + _MARGIN) for x, y in points]
        number = counts.get(edge, 0)
        x, y = label or points[len(points) // 3]
        shapes.append(
            EdgeShape(
                _spline(moved[:-1]),
                _head(moved[-2], moved[-1]),
                round(x + _MARGIN, 1),
                round(y + _MARGIN + 4, 1),
                '{} {}'.format(shortened(edge.outcome, _EDGE_NAME), number),
                '{} from {} to {}: {} times'.format(edge.outcome, edge.source, edge.target, number),
                round(_THIN + (_THICK - _THIN) * number / most, 1) if number else 0.8,
                number,
            )
        )
    return shapes


def _spline(points: Sequence[Point]) -> str:
    first, rest = points[0], points[1:]
    line = 'M{:g},{:g}'.format(*_rounded(first))
    for at in range(0, len(rest) - 2, 3):
        curve = ' '.join('{:g},{:g}'.format(*_rounded(each)) for each in rest[at : at + 3])
        line += 'C' + curve
    return line


def _head(end: Point, tip: Point) -> str:
    """Return the corners of an arrow's head, from where the line ends to its tip."""
    along = tip[0] - end[0], tip[1] - end[1]
    length = math.hypot(*along) or 1.0
    across = -along[1] / length * _ARROW, along[0] / length * _ARROW
    corners = (
        (end[0] + across[0], end[1] + across[1]),
        tip,
        (end[0] - across[0], end[1] - across[1]),
    )
    return ' '.join('{:g},{:g}'.format(*_rounded(each)) for each in corners)


def _rounded(point: Point) -> Point:
    return round(point[0], 1), round(point[1], 1)


def jumps_of(taken: Taken) -> List[Tuple[str, str, str, int]]:
    """Return from where, to where, by whom and how often, the most frequent ones first."""
    return [
        (jump.state, jump.target, 'a person' if jump.by_person else 'the oracle', number)
        for jump, number in sorted(taken.jumps.items(), key=lambda each: (-each[1], each[0]))
    ]
