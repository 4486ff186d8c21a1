"""The plan of a machine: containers, states, and where each outcome leads."""

from typing import Dict, Iterator, List, NamedTuple, Tuple, Union

TOP = 'TOP'
DONE, PREEMPTED = 'succeeded', 'preempted'
MACHINE, CONCURRENT, ITERATED = 'machine', 'concurrent', 'iterated'


class Leaf(NamedTuple):
    """A state that works on the hidden world."""

    path: str
    work: Tuple[str, ...]  # its outcomes of success. The first one leads on
    failing: Tuple[str, ...]
    is_preemptable: bool
    leads: Dict[str, str]  # by outcome: a label of its container, or an end of that
    is_aside: bool = False  # only failures of the state before lead to it

    @property
    def label(self) -> str:
        """Its name in its container."""
        return self.path.rsplit('/', 1)[1]

    @property
    def outcomes(self) -> Tuple[str, ...]:
        """All of them."""
        return self.work + self.failing + (PREEMPTED,) * self.is_preemptable


class Box(NamedTuple):
    """A container: a StateMachine, a Concurrence of its children, or an Iterator over its child."""

    path: str
    kind: str
    children: Tuple['Node', ...]
    ends: Tuple[str, ...]  # failing ones
    leads: Dict[str, str]  # of its own outcomes, in the container around
    items: int = 0

    label = Leaf.label
    is_aside = False

    @property
    def outcomes(self) -> Tuple[str, ...]:
        """All of them."""
        return (DONE, PREEMPTED) + self.ends


Node = Union[Leaf, Box]


def leaves_of(box: Box) -> Iterator[Leaf]:
    """All leaves, in the order in which a machine that meets no failure comes to them."""
    for child in box.children:
        if isinstance(child, Leaf):
            yield child
        else:
            yield from leaves_of(child)


def boxes_of(box: Box) -> List[Box]:
    """It and all containers below it."""
    found = [box]
    for child in box.children:
        if isinstance(child, Box):
            found += boxes_of(child)
    return found
