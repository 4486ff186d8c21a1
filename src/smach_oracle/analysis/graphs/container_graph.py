"""The graph of one container: states and edges, their layout, the drawing for the page. Pure.

ORACLE is left out of the layout: with one edge from and one to every state it would pull all others
to itself. The page draws it beside the rest, and its edges as thin curves.
"""

import json
from collections import Counter
from typing import Any, Dict, FrozenSet, Iterable, List, NamedTuple, Optional, Set, Tuple

from smach_oracle.oracle.settings.failing_outcomes import is_preempted

from .drawn_graph import GraphEdgeView, GraphView, Place, Spot, TransitionCount

MOST_STATES = 2000  # of a container. One with more is refused
MOST_EDGES = 20_000  # likewise
MOST_DRAWN = 150  # states. dot would take minutes for more, and nobody could read the drawing
# edges of preemption that are drawn. More are a thicket: they stand as one number at their end
MOST_PREEMPTED = 5
# edges up to which dot keeps room for their labels. Beyond, it would take minutes
MOST_LABELLED = 100
# of a large graph: fewer rounds of making it prettier
_HASTE = ' nslimit=2; nslimit1=2; mclimit=0.3;'
# of a state's box, in pixels
_CHARACTER, _PADDING, _NARROWEST, _WIDEST, _HEIGHT = 8.7, 28.0, 118.0, 300.0, 46.0
_PIXELS_PER_INCH = 72.0


class GraphEdge(NamedTuple):
    """One edge, by labels."""

    source: str
    outcome: str
    target: str


class ContainerGraph(NamedTuple):
    """A container's states and edges."""

    path: str
    states: Tuple[str, ...]  # ORACLE not among them
    outcomes: Tuple[str, ...]
    edges: Tuple[GraphEdge, ...]  # those of ORACLE not among them
    oracle: str  # label of the meta state, '' where there is none
    refused: int = 0  # number of its states where they are too many: none of them is told

    @property
    def is_small(self) -> bool:
        """Whether a drawing of the whole can be made, and read."""
        return 0 < len(self.states) <= MOST_DRAWN

    @property
    def bundled(self) -> Dict[str, int]:
        """Return outcomes to which many states lead by a preemption, and their number."""
        ends = Counter(edge.target for edge in self.edges if self._is_preemption(edge))
        return {end: number for end, number in ends.items() if number > MOST_PREEMPTED}

    def drawn_edges(self) -> FrozenSet[GraphEdge]:
        """Return the edges that are drawn, each by itself."""
        bundled = self.bundled
        return frozenset(
            edge
            for edge in self.edges
            if edge.target not in bundled or not self._is_preemption(edge)
        )

    def _is_preemption(self, edge: GraphEdge) -> bool:
        return is_preempted(edge.outcome) and edge.target in self.outcomes


class GraphLayout(NamedTuple):
    """The places of states and transitions, in pixels from the upper left corner."""

    width: float
    height: float
    nodes: Dict[str, Tuple[float, float, float, float]]  # id -> centre x, y, width, height
    # id -> Bezier points, label
    edges: Dict[str, Tuple[List[Spot], Optional[Spot]]]


def make_structure(
    path: str, children: Iterable[str], edges: Iterable[GraphEdge], outcomes: Iterable[str]
) -> ContainerGraph:
    """Return the graph of a container as its introspection server publishes it."""
    labels = list(dict.fromkeys(children))
    all_edges = list(dict.fromkeys(edges))
    oracle = find_oracle(labels, all_edges)
    if len(labels) - bool(oracle) > MOST_STATES or len(all_edges) > MOST_EDGES:
        return ContainerGraph(path, (), (), (), '', len(labels) - bool(oracle))
    states = tuple(label for label in labels if label != oracle)
    ends = tuple(dict.fromkeys(outcome for outcome in outcomes if outcome not in labels))
    known = set(states) | set(ends)
    own = tuple(edge for edge in all_edges if edge.source in states and edge.target in known)
    return ContainerGraph(path, states, ends, own, oracle)


def find_oracle(labels: List[str], edges: List[GraphEdge]) -> str:
    """Return the label of the meta state, '' where there is none.

    Every other state leads to it, and its outcomes are named for where they lead.
    """
    sources: Dict[str, Set[str]] = {}
    targets: Dict[str, Set[str]] = {}
    for edge in edges:
        sources.setdefault(edge.target, set()).add(edge.source)
        if edge.outcome == edge.target:
            targets.setdefault(edge.source, set()).add(edge.target)
    for label in labels:
        rest = set(labels) - {label} if len(targets.get(label, ())) >= len(labels) - 1 else set()
        if rest and rest <= sources.get(label, set()) and rest <= targets[label]:
            return label
    return ''


def dot_text(structure: ContainerGraph) -> str:
    """Return the graph in dot's language.

    No text of a robot is in it: nodes and edges are numbered, labels are runs of x.
    """
    names, drawn = _names(structure), structure.drawn_edges()
    large = len(drawn) > MOST_LABELLED
    lines = [
        'digraph {',
        'rankdir=TB; nodesep=0.35; ranksep=0.5; node [shape=box, fixedsize=true];'
        ' edge [fontsize=11];' + (_HASTE if large else ''),
    ]
    for label, name in names.items():
        width, height = box(label) if label in structure.states else (box(label)[0] * 0.9, 30.0)
        lines.append(
            '{} [width={:.3f}, height={:.3f}];'.format(
                name, width / _PIXELS_PER_INCH, height / _PIXELS_PER_INCH
            )
        )
    if structure.outcomes:
        lines.append(
            '{{rank=sink; {}}}'.format('; '.join(names[outcome] for outcome in structure.outcomes))
        )
    for number, edge in enumerate(structure.edges):
        if edge not in drawn:
            continue
        label = '' if large else ', label="{}"'.format('x' * min(24, len(edge.outcome) + 5))
        lines.append(
            '{} -> {} [id=e{}{}];'.format(names[edge.source], names[edge.target], number, label)
        )
    return '\n'.join(lines + ['}'])


def box(label: str) -> Tuple[float, float]:
    """Width and height of a state's box, in pixels."""
    return min(_WIDEST, max(_NARROWEST, len(label) * _CHARACTER + _PADDING)), _HEIGHT


def read_layout(text: str) -> GraphLayout:
    """Return the layout that `dot -Tjson0` has written.

    :raises ValueError: for any other text.
    """
    try:
        data = json.loads(text)
        left, bottom, right, top = (float(number) for number in data['bb'].split(','))
        nodes = {
            each['name']: _node(each, top)
            for each in data.get('objects', [])
            if 'nodes' not in each
        }
        edges = {each['id']: _edge(each, top) for each in data.get('edges', [])}
    except (KeyError, TypeError, AttributeError) as err:
        raise ValueError('dot has written something unexpected: {!r}'.format(err)) from err
    return GraphLayout(right - left, top - bottom, nodes, edges)


def drawing(
    structure: ContainerGraph, layout: Optional[GraphLayout], nested: Iterable[str]
) -> GraphView:
    """The section of a graph: plain data for the page. Positions only where there is a layout.

    :param nested: labels of the states that are containers themselves.
    """
    names = _names(structure)
    inner = set(nested)
    return {
        'path': structure.path,
        'oracle': structure.oracle,
        'drawn': layout is not None,
        'size': (layout.width, layout.height) if layout else None,
        'states': [
            {'label': label, 'nested': label in inner, 'at': _place(layout, names[label])}
            for label in structure.states
        ],
        'outcomes': [
            {'label': label, 'at': _place(layout, names[label])} for label in structure.outcomes
        ],
        'edges': [
            _edge_view(edge, layout, 'e{}'.format(number))
            for number, edge in enumerate(structure.edges)
        ],
        'bundled': structure.bundled,
        'refused': structure.refused,
    }


def _edge_view(edge: GraphEdge, layout: Optional[GraphLayout], name: str) -> GraphEdgeView:
    drawn = layout.edges.get(name) if layout else None
    points, label = drawn or ([], None)
    return {
        'from': edge.source,
        'outcome': edge.outcome,
        'to': edge.target,
        'points': [coordinate for point in points for coordinate in point],
        'label': label,
    }


def _names(structure: ContainerGraph) -> Dict[str, str]:
    labels = list(structure.states) + [
        outcome for outcome in structure.outcomes if outcome not in structure.states
    ]
    return {label: 'n{}'.format(number) for number, label in enumerate(labels)}


def _place(layout: Optional[GraphLayout], name: str) -> Optional[Place]:
    found = layout.nodes.get(name) if layout else None
    if found is None:
        return None
    x, y, width, height = found
    return round(x, 1), round(y, 1), round(width, 1), round(height, 1)


def _node(data: Dict[str, Any], top: float) -> Tuple[float, float, float, float]:
    x, y = (float(number) for number in data['pos'].split(','))
    return (
        x,
        top - y,
        float(data['width']) * _PIXELS_PER_INCH,
        float(data['height']) * _PIXELS_PER_INCH,
    )


def _edge(data: Dict[str, Any], top: float) -> Tuple[List[Spot], Optional[Spot]]:
    """The spline's points, its arrow's tip at the end."""
    tip: List[Spot] = []
    points = []
    for part in data['pos'].split():
        if part.startswith('e,'):
            tip = [_point(part[2:], top)]
        elif not part.startswith('s,'):
            points.append(_point(part, top))
    return points + tip, _point(data['lp'], top) if 'lp' in data else points[
        len(points) // 3
    ] if points else None


def _point(text: str, top: float) -> Spot:
    x, y = (float(number) for number in text.split(','))
    return round(x, 1), round(top - y, 1)


def shares(counts: Iterable[Tuple[str, str, str, int]]) -> List[TransitionCount]:
    """Rows of [source, outcome, target, times, share of all that left the source]."""
    rows = list(counts)
    totals: Dict[str, int] = Counter()
    for source, _, _, times in rows:
        totals[source] += times
    return [
        (source, outcome, target, times, round(times / totals[source], 4))
        for source, outcome, target, times in rows
        if totals[source]
    ]


def structure_from_counts(
    path: str, labels: List[str], counts: List[TransitionCount]
) -> ContainerGraph:
    """Return a container of which only its labels and the transitions taken are known.

    :param counts: rows as of `shares`.
    """
    targets = {str(target) for _, _, target, _, _ in counts}
    oracle: Optional[str] = next(
        (
            str(source)
            for source, outcome, target, _, _ in counts
            if outcome == target and source not in labels
        ),
        None,
    )
    edges = tuple(
        GraphEdge(source, outcome, target)
        for source, outcome, target, _, _ in counts
        if source in labels and target != oracle
    )
    outcomes = tuple(sorted(targets - set(labels) - {oracle or ''}))
    return ContainerGraph(path, tuple(labels), outcomes, edges, oracle or '')
