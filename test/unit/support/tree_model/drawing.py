"""Trees drawn at random."""

import random
from typing import Any, Dict, List, NamedTuple, Optional, Tuple

from .plan import (
    KEYS,
    TOP,
    Beside,
    Check,
    Leaf,
    Machine,
    Node,
    Repeated,
    StateSettings,
    TreePlan,
    children_of,
    machines_of,
    nodes_below,
)

BAD = ('aborted', 'grasp_failed', 'odd')
SUCCESS = 'succeeded'


class Shape(NamedTuple):
    """What the trees may hold."""

    depth: int = 4
    concurrent: bool = True
    iterated: bool = True
    leaf_branches: bool = True  # leafs directly in Iterators and Concurrences
    preempts: bool = True
    time_limits: bool = True
    beside_beside: bool = True  # Concurrences in Concurrences
    guarded: bool = True  # states that are not repeated
    guarded_beside: bool = True  # also in Concurrences


ANY = Shape()
# there a preempt reaches branches in branches at no certain moment
UPSTREAM = Shape(beside_beside=False, guarded_beside=False)


def draw(seed: object, shape: Shape = ANY) -> TreePlan:
    """The tree of that seed."""
    return _Drawing(str(seed), shape).plan()


class _Drawing:
    def __init__(self, seed: str, shape: Shape) -> None:
        self._seed = seed
        self._shape = shape
        self._chance = random.Random('tree ' + seed)
        self._number = 0
        chance = self._chance
        self._trouble = chance.choice((0.15, 0.3, 0.5, 0.7))
        self._preempts = shape.preempts and chance.random() < 0.3
        self._left = chance.choice((6, 10, 20))  # leafs
        self._reports = random.Random('reports ' + seed).random() < 0.25
        self._guards = shape.guarded and random.Random('guards ' + seed).random() < 0.35

    def plan(self) -> TreePlan:
        chance = self._chance
        depth = chance.randint(min(1, self._shape.depth), self._shape.depth)
        top = self._machine(TOP, depth, False)
        plan = TreePlan(
            self._seed,
            top,
            policy=chance.choice(('prose', 'algorithm1')),
            estimator=chance.choice(('window', 'exponential')),
            memory=chance.choice((2, 4, 10)),
            prior=chance.choice((0.05, 0.1, 0.3)),
            max_recoveries=chance.choice((0, 1, 2, 5, 5)),
            budget=self._budget(),
            author_recoveries=self._one_of('keep', 'override', 0.2),
            userdata=self._one_of('restore', 'keep', 0.3),
            escalate=chance.random() < 0.4,
            on_no_answer=('stop', ''),
            has_expert=chance.random() < 0.85,
            states={},
        )
        plan = plan._replace(on_no_answer=self._fallback(plan))
        for path, node in nodes_below(TOP, top):
            self._settings(plan.states, path, node)
        return plan

    def _one_of(self, usual: str, other: str, share: float) -> str:
        return other if self._chance.random() < share else usual

    def _budget(self) -> Dict[str, int]:
        budget = {}
        if self._chance.random() < 0.3:
            budget['recoveries'] = self._chance.choice((0, 2, 5, 10))
        if self._chance.random() < 0.25:
            budget['questions'] = self._chance.choice((0, 1, 3))
        return budget

    def _fallback(self, plan: TreePlan) -> Tuple[str, str]:
        drawn = self._chance.random()
        if drawn < 0.6:
            return 'stop', ''
        if drawn < 0.8 and all('aborted' in machine.outcomes for _, machine in machines_of(plan)):
            return 'give_up', 'aborted'
        return 'goto', self._chance.choice(
            [
                '{}/{}'.format(path, child.label)[len(TOP) + 1 :]
                for path, machine in machines_of(plan)
                for child in machine.children
            ]
        )

    # -- nodes

    def _label(self, letter: str) -> str:
        self._number += 1
        return '{}{}'.format(letter, self._number)

    def _some_keys(self) -> Tuple[str, ...]:
        return tuple(key for key in KEYS if self._chance.random() < 0.7)

    def _leaf(self, beside: bool) -> Leaf:
        chance = self._chance
        more = tuple(name for name in BAD + ('again',) if chance.random() < 0.4)
        kinds = ['end'] * 6 + ['raise', 'stray']
        if self._preempts:
            kinds.append('preempt')
        overruns = not beside and self._shape.time_limits and chance.random() < 0.02
        outcomes = tuple(dict.fromkeys(('ok', 'aborted', 'preempted') + more))
        self._left -= 1
        return Leaf(
            self._label('L'),
            outcomes,
            self._some_keys(),
            self._some_keys(),
            self._trouble * chance.choice((0.0, 1.0, 1.0)),
            tuple(kinds),
            overruns,
        )

    def _that_succeeds(self, leaf: Leaf) -> Leaf:
        """Some have an outcome that is a success by its name, too."""
        if self._apart(leaf.label).random() < 0.8:
            return leaf
        return leaf._replace(outcomes=(*leaf.outcomes, SUCCESS))

    def _apart(self, label: str) -> random.Random:
        """A chance that leaves the rest of the tree as it is."""
        return random.Random('succeeds {} {}'.format(self._seed, label))

    def _child(self, depth: int, beside: bool) -> Node:
        drawn = self._chance.random()
        if depth <= 0 or self._left <= 0 or drawn < 0.5:
            return self._that_succeeds(self._leaf(beside))
        if drawn < 0.6 and self._may_be_beside(beside):
            return self._beside(depth - 1)
        if drawn < 0.7 and self._shape.iterated:
            return self._repeated(depth - 1, beside)
        return self._machine(self._label('M'), depth - 1, beside)

    def _outcomes(self) -> Tuple[str, ...]:
        chance = self._chance
        outcomes = ['ok']
        if chance.random() < 0.95:
            outcomes.append('preempted')
        if chance.random() < 0.9 or 'preempted' not in outcomes:
            outcomes.append('aborted')
        if chance.random() < 0.25:
            outcomes.append('odd')
        return tuple(outcomes)

    def _machine(self, label: str, depth: int, beside: bool) -> Machine:
        chance = self._chance
        outcomes = self._outcomes()
        children = tuple(self._child(depth, beside) for _ in range(chance.randint(1, 4)))
        labels = [child.label for child in children]
        transitions = {
            child.label: self._transitions(child, labels, index, outcomes)
            for index, child in enumerate(children)
        }
        if self._reports and len(children) > 1 and 'aborted' in outcomes:
            self._lead_to_a_report(children, transitions)
        return Machine(
            label,
            outcomes,
            children,
            transitions,
            {child.label: self._remapping() for child in children},
            self._some_keys(),
            is_sequence=chance.random() < 0.2,
        )

    def _lead_to_a_report(
        self, children: Tuple[Node, ...], transitions: Dict[str, Dict[str, str]]
    ) -> None:
        """The author leads failures to the last state, which ends the machine in a failure."""
        *others, last = children
        chance = self._apart(last.label + ' reports')
        for child in others:
            for outcome in child.outcomes:
                if outcome in BAD and chance.random() < 0.6:
                    transitions[child.label][outcome] = last.label
        for outcome in last.outcomes:
            if outcome in ('ok', 'odd', 'again', SUCCESS) and chance.random() < 0.6:
                transitions[last.label][outcome] = 'aborted'

    def _remapping(self) -> Dict[str, str]:
        if self._chance.random() < 0.7:
            return {}
        return dict(zip(KEYS, self._chance.sample(KEYS, len(KEYS))))

    def _transitions(
        self, child: Node, labels: List[str], index: int, outcomes: Tuple[str, ...]
    ) -> Dict[str, str]:
        following = labels[index + 1] if index + 1 < len(labels) else 'ok'
        drawn = {'ok': following}
        for outcome in child.outcomes[1:]:
            if outcome == SUCCESS:
                ends = [name for name in outcomes if name != 'preempted']
                drawn[outcome] = self._apart(child.label + ' leads').choice(ends + labels[index:])
                continue
            target = self._target(outcome, labels, index, outcomes)
            if target is not None:
                drawn[outcome] = target
        return drawn

    def _target(
        self, outcome: str, labels: List[str], index: int, outcomes: Tuple[str, ...]
    ) -> Optional[str]:
        """Where the author leads an outcome; None: it falls through."""
        chance = self._chance
        ends = [name for name in outcomes if name != 'preempted']
        if outcome == 'preempted':
            return None if outcome in outcomes else chance.choice(ends)
        if outcome == 'again':
            return chance.choice(labels[: index + 1])
        drawn = chance.random()
        if drawn < 0.2:
            return chance.choice(labels)
        if drawn < 0.3 or outcome not in outcomes:
            return chance.choice(['aborted'] * (4 * ('aborted' in ends)) + ends)
        return None

    def _may_be_beside(self, beside: bool) -> bool:
        return self._shape.concurrent and (self._shape.beside_beside or not beside)

    def _beside(self, depth: int) -> Beside:
        chance = self._chance
        children = tuple(self._branch(depth) for _ in range(chance.randint(1, 3)))
        outcomes = ('ok', 'aborted', 'preempted')
        outcome_map = {'ok': {child.label: 'ok' for child in children}}
        return Beside(
            self._label('C'),
            outcomes,
            children,
            'aborted',
            outcome_map,
            self._some_keys(),
            ('aborted',) if chance.random() < 0.3 else (),
        )

    def _branch(self, depth: int) -> Node:
        if self._shape.leaf_branches and self._chance.random() < 0.3:
            return self._leaf(True)
        if depth > 0 and self._shape.iterated and self._chance.random() < 0.15:
            return self._repeated(depth - 1, True)
        return self._machine(self._label('B'), depth, True)

    def _repeated(self, depth: int, beside: bool) -> Repeated:
        chance = self._chance
        if self._shape.leaf_branches and chance.random() < 0.3:
            child: Any = self._leaf(beside)
        elif depth > 0 and self._may_be_beside(beside) and chance.random() < 0.1:
            child = self._beside(depth - 1)
        elif depth > 0 and chance.random() < 0.15:
            child = self._repeated(depth - 1, beside)
        else:
            child = self._machine(self._label('E'), depth, beside)
        loop = tuple(
            name
            for name in child.outcomes
            if name == 'ok' or name != 'preempted' and chance.random() < 0.15
        )
        outcomes = tuple(dict.fromkeys(child.outcomes + ('ok', 'aborted')))
        final = {
            name: chance.choice(outcomes)
            for name in child.outcomes
            if name not in ('ok', 'preempted') and chance.random() < 0.2
        }
        return Repeated(
            self._label('I'), outcomes, child, chance.randint(1, 3), loop, final, self._some_keys()
        )

    # -- settings of states

    def _settings(
        self, states: Dict[Tuple[str, str], StateSettings], path: str, node: Node
    ) -> None:
        chance = self._chance
        for index, child in enumerate(children_of(node)):
            if not isinstance(node, Machine) and not isinstance(child, Leaf):
                continue
            limit = chance.choice((0, 1, 3)) if chance.random() < 0.1 else None
            listed = tuple(
                name
                for name in child.outcomes
                if name not in ('ok', 'preempted', SUCCESS) and chance.random() < 0.1
            )
            states[path, child.label] = StateSettings(
                self._checks(node, index),
                listed,
                self._intended(path, child),
                prior=chance.choice((0.2, 0.5, 0.8)) if chance.random() < 0.15 else None,
                max_recoveries=limit,
                author_recoveries=(
                    chance.choice(('keep', 'override')) if chance.random() < 0.1 else None
                ),
                memory=chance.choice((1, 3)) if chance.random() < 0.1 else None,
                on_retry=self._on_retry(path, node),
            )

    def _intended(self, path: str, child: Node) -> Tuple[str, ...]:
        """Outcomes that are meant so, drawn by a chance of their own."""
        chance = random.Random('intended {} {}/{}'.format(self._seed, path, child.label))
        bad = [name for name in child.outcomes if name in BAD + ('again',)]
        return (chance.choice(bad),) if bad and chance.random() < 0.05 else ()

    def _on_retry(self, path: str, node: Node) -> str:
        is_beside = isinstance(node, Beside) or '/C' in path
        may_be = self._guards and (self._shape.guarded_beside or not is_beside)
        if not may_be or self._chance.random() >= 0.25:
            return 'allow'
        return self._chance.choice(('confirm', 'confirm', 'never'))

    def _checks(self, node: Node, index: int) -> Tuple[Check, ...]:
        chance = self._chance
        if chance.random() < 0.7:
            return ()
        checks = []
        for number in range(chance.randint(1, 2)):
            others = [
                child.label
                for child in children_of(node)[:index]
                if isinstance(node, Machine)
                and isinstance(child, Leaf)
                and 'preempt' not in child.kinds
                and not child.overruns
            ]
            if others and chance.random() < 0.4:
                checks.append(Check(chance.choice(others), is_label=True))
            else:
                checks.append(
                    Check(
                        'check_{}'.format(number),
                        writes=(chance.choice(KEYS) if chance.random() < 0.5 else None),
                    )
                )
        return tuple(dict.fromkeys(checks))
