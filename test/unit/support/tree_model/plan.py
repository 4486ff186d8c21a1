"""The plan of a tree: what the executive's machines and the model's are both made of."""

import random
from typing import Any, Dict, Iterator, List, NamedTuple, Optional, Tuple, Union

KEYS = ('a', 'b', 'c')
TOP = 'T'
MOST_ENTRIES = 250  # of leafs in a trial; there its course is cut off
CUT = 'cut off'
PATIENCE = 12  # executions of a leaf; behind them it succeeds


class Action(NamedTuple):
    """What a leaf does in one execution."""

    kind: str  # end, raise, stray (an outcome that is not registered), preempt (the whole tree)
    outcome: Optional[str] = None


class Leaf(NamedTuple):
    """A state that does no more than its script says."""

    label: str
    outcomes: Tuple[str, ...]
    reads: Tuple[str, ...]
    writes: Tuple[str, ...]
    trouble: float  # how often it does not succeed
    kinds: Tuple[str, ...]  # of trouble
    overruns: bool = False  # its time limit, each time


class Machine(NamedTuple):
    """A StateMachine, or a Sequence."""

    label: str
    outcomes: Tuple[str, ...]
    children: Tuple[Any, ...]
    transitions: Dict[str, Dict[str, str]]
    remappings: Dict[str, Dict[str, str]]
    keys: Tuple[str, ...]  # input and output
    is_sequence: bool = False


class Beside(NamedTuple):
    """A Concurrence."""

    label: str
    outcomes: Tuple[str, ...]
    children: Tuple[Any, ...]
    default: str
    outcome_map: Dict[str, Dict[str, str]]
    keys: Tuple[str, ...]
    stops_at: Tuple[str, ...] = ()  # outcomes of a child that end the others


class Repeated(NamedTuple):
    """An Iterator."""

    label: str
    outcomes: Tuple[str, ...]
    child: Any
    items: int
    loop_outcomes: Tuple[str, ...]
    final_map: Dict[str, str]
    keys: Tuple[str, ...]


Node = Union[Leaf, Machine, Beside, Repeated]


class Check(NamedTuple):
    """A precondition: a function that looks and may write, or another state."""

    name: str
    is_label: bool = False
    writes: Optional[str] = None


class StateSettings(NamedTuple):
    """What is set of one state; None: as for all."""

    preconditions: Tuple[Check, ...] = ()
    failure_outcomes: Tuple[str, ...] = ()
    intended_outcomes: Tuple[str, ...] = ()
    prior: Optional[float] = None
    max_recoveries: Optional[int] = None
    author_recoveries: Optional[str] = None
    memory: Optional[int] = None
    on_retry: str = 'allow'


class TreePlan(NamedTuple):
    """A tree, its settings, and where all that happens by chance comes from."""

    seed: str
    top: Machine
    policy: str
    estimator: str
    memory: int
    prior: float
    max_recoveries: int
    budget: Dict[str, int]
    author_recoveries: str
    userdata: str
    escalate: bool
    on_no_answer: Tuple[str, str]  # stop; goto, PATH/LABEL; give_up, outcome
    has_expert: bool
    states: Dict[Tuple[str, str], StateSettings]

    def of(self, path: str, label: str) -> StateSettings:
        """The settings of one state."""
        return self.states.get((path, label), StateSettings())

    def action(self, path: str, leaf: Leaf, number: int) -> Action:
        """What a leaf does in its execution of that number, from 0."""
        chance = random.Random('{} {}/{} {}'.format(self.seed, path, leaf.label, number))
        if number >= PATIENCE or chance.random() >= leaf.trouble:
            good = [name for name in ('ok', 'again') if name in leaf.outcomes]
            return Action('end', 'ok' if number > PATIENCE // 2 else chance.choice(good))
        kind = chance.choice(leaf.kinds)
        if kind == 'end':
            bad = [name for name in leaf.outcomes if name not in ('ok', 'again', 'preempted')]
            return Action('end', chance.choice(bad))
        if kind == 'preempt':
            return Action('preempt', chance.choice(('preempted', 'preempted', 'aborted')))
        if kind == 'stray':
            return Action('stray', chance.choice(('nonsense', None)))
        return Action(kind)

    def holds(self, path: str, label: str, check: Check, number: int) -> bool:
        """Whether a function among the preconditions says yes when it is called for that time."""
        return (
            random.Random(
                '{} {}/{} {} {}'.format(self.seed, path, label, check.name, number)
            ).random()
            < 0.6
        )


def children_of(node: Node) -> List[Node]:
    """The nodes directly below."""
    if isinstance(node, Leaf):
        return []
    return [node.child] if isinstance(node, Repeated) else list(node.children)


def nodes_below(path: str, node: Node) -> Iterator[Tuple[str, Node]]:
    """All containers from this one down, with their paths; outer ones first."""
    yield path, node
    for child in children_of(node):
        if not isinstance(child, Leaf):
            yield from nodes_below('{}/{}'.format(path, child.label), child)


def machines_of(plan: TreePlan) -> List[Tuple[str, Machine]]:
    """All StateMachines and Sequences, with their paths."""
    return [(path, node) for path, node in nodes_below(TOP, plan.top) if isinstance(node, Machine)]
