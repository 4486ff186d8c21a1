"""A graph as a page draws it. Lengths are px."""

from typing import Dict, List, Optional, Tuple, TypedDict

Place = Tuple[float, float, float, float]  # x and y of the middle, width, height
Spot = Tuple[float, float]  # x, y
# a transition that was taken: state, outcome, target, how often, share of all that left its state
TransitionCount = Tuple[str, str, str, int, float]


class GraphStateView(TypedDict):
    """A state in a graph."""

    label: str
    nested: bool
    at: Optional[Place]


class GraphOutcomeView(TypedDict):
    """An outcome of the container, in its graph."""

    label: str
    at: Optional[Place]


GraphEdgeView = TypedDict(
    'GraphEdgeView',
    {
        'from': str,
        'outcome': str,
        'to': str,
        'points': List[float],  # x, y, x, y, ... of Bezier curves, the arrow's tip at the end
        'label': Optional[Spot],
    },
)


class GraphView(TypedDict):
    """A container, and where dot has laid its states."""

    path: str
    oracle: str  # its label; '' where there is none
    drawn: bool  # whether there is a layout
    size: Optional[Tuple[float, float]]  # width, height
    states: List[GraphStateView]
    outcomes: List[GraphOutcomeView]
    edges: List[GraphEdgeView]
    bundled: Dict[str, int]  # edges of preemption that have no points, by outcome
    refused: int  # states, where they are too many: none of them is told. Else 0
