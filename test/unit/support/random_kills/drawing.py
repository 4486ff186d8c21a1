"""Trees drawn at random in which every state runs once, unless it is decided otherwise."""

import random
from typing import Dict, Iterator, List, NamedTuple, Tuple

TOP = 'TOP'
LINES = ('machine', 'sequence')  # of which one child runs after another


class Node(NamedTuple):
    """A state (`leaf`) or a container; `items`: of an Iterator; `failures`: first visits that
    fail.
    """

    kind: str
    label: str
    children: Tuple['Node', ...] = ()
    items: int = 0
    failures: int = 0


class Tree(NamedTuple):
    """A tree, with the paths of its nodes from the top."""

    seed: str
    top: Node
    nodes: Dict[str, Node]

    @property
    def leaves(self) -> List[str]:
        """The paths of all states that are no containers."""
        return [path for path, node in self.nodes.items() if node.kind == 'leaf']

    def iterators_above(self, path: str) -> List[str]:
        """The paths of the Iterators that hold a node, outermost first."""
        return [
            above
            for above in ways_down(path)
            if above != path and self.nodes[above].kind == 'repeated'
        ]

    def precede(self, path: str, later: str) -> bool:
        """Whether a node ends before another begins, in each round of what holds both."""
        holder, index, later_index = _meeting(self, path, later)
        return holder in self.nodes and self.nodes[holder].kind in LINES and index < later_index

    def is_behind(self, path: str, target: str) -> bool:
        """Whether a node is `target`, is in it, or follows it in the container that has it."""
        holder = target.rpartition('/')[0]
        if not path.startswith(holder + '/'):
            return False
        child = holder + '/' + path[len(holder) + 1 :].split('/')[0]
        return child == target or self.precede(target, child)

    def visits_of(self, path: str) -> List[Tuple[int, ...]]:
        """The items of the Iterators above with which a state is to run."""
        found: List[Tuple[int, ...]] = [()]
        for above in self.iterators_above(path):
            found = [items + (item,) for items in found for item in range(self.nodes[above].items)]
        return found


def ways_down(path: str) -> Iterator[str]:
    """Yield the path of each node on the way to one."""
    parts = path.split('/')
    return ('/'.join(parts[:count]) for count in range(1, len(parts) + 1))


def _meeting(tree: Tree, one: str, other: str) -> Tuple[str, int, int]:
    """The container where two nodes part, and their indices in it; '' where one holds the other."""
    parts, others = one.split('/'), other.split('/')
    shared = 0
    while shared < min(len(parts), len(others)) and parts[shared] == others[shared]:
        shared += 1
    if shared in (len(parts), len(others)):
        return '', 0, 0
    holder = '/'.join(parts[:shared])
    labels = [child.label for child in tree.nodes[holder].children]
    return holder, labels.index(parts[shared]), labels.index(others[shared])


def draw(seed: object) -> Tree:
    """The tree of that seed."""
    drawing = _Drawing(str(seed))
    top = drawing.line(TOP, 3, 'machine')
    return Tree(str(seed), top, dict(walk(TOP, top)))


def walk(path: str, node: Node) -> Iterator[Tuple[str, Node]]:
    yield path, node
    for child in node.children:
        yield from walk('{}/{}'.format(path, child.label), child)


class _Drawing:
    def __init__(self, seed: str) -> None:
        self._chance = random.Random('killed tree ' + seed)
        self._fails = self._chance.choice((0.0, 0.0, 0.3))
        self._number = 0
        self._left = self._chance.choice((6, 10, 16))

    def _label(self, letter: str) -> str:
        self._number += 1
        return '{}{}'.format(letter, self._number)

    def line(self, label: str, depth: int, kind: str) -> Node:
        return Node(
            kind, label, tuple(self._child(depth) for _ in range(self._chance.randint(2, 4)))
        )

    def _child(self, depth: int) -> Node:
        chance = self._chance
        drawn = chance.random()
        if depth <= 0 or self._left <= 0 or drawn < 0.4:
            self._left -= 1
            return Node(
                'leaf',
                self._label('L'),
                failures=int(chance.random() < self._fails) * (chance.randint(1, 2)),
            )
        if drawn < 0.65:
            return self.line(self._label('M'), depth - 1, chance.choice(LINES))
        if drawn < 0.85:
            return Node(
                'beside',
                self._label('C'),
                tuple(self._child(depth - 1) for _ in range(chance.randint(2, 3))),
            )
        return Node('repeated', self._label('I'), (self._child(depth - 1),), chance.randint(2, 3))
