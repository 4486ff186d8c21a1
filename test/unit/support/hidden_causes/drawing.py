"""Machines drawn with the statistics of public programs (`figures.py`).

The chain of the first work outcomes leads through a container, and leaves it with `succeeded`. Some
states lie aside of that chain: the author leads to them from a failing outcome of the state before,
to mend something, to give word, or to go on in another way. All that is not settled so is drawn by
the shares of `figures.LEADS`, less what is settled.
"""

from typing import Dict, List, NamedTuple, Optional, Sequence

from . import figures
from .chance import Chance
from .plan import CONCURRENT, DONE, ITERATED, MACHINE, PREEMPTED, TOP, Box, Leaf, Node

ASIDE = 0.30  # of the states behind one that can fail
# where the work outcome of a state aside leads
FROM_ASIDE = {'back': 0.70, 'leave': 0.15, 'on': 0.15}
# the shares that are left for outcomes that nothing settles
MORE_WORK = {'leave': 0.40, 'back': 0.65, 'forward': 0.05, 'self': 0.35, 'next': 0.01}
MORE_FAILING = {'leave': 0.58, 'back': 0.35, 'next': 0.08, 'forward': 0.12, 'self': 0.12}
LOOPING = 0.50  # of the containers. The others have no way back at all
WAYS_BACK = ('back', 'self')
MORE_NAMES = ('again', 'other', 'empty', 'left', 'right', 'stopped', 'no', 'done')
MOST_BRANCHES = 5
MOST_ITEMS = 4


class _Slots(NamedTuple):
    """A container as it is laid out: which slot holds which container."""

    size: int
    kind: str
    inner: Dict[int, int]


def draw(seed: int) -> Box:
    """The machine of that seed."""
    return _Drawing(seed).machine()


class _Drawing:
    def __init__(self, seed: int) -> None:
        self._chance = Chance('machine', seed)
        self._number = 0
        # an author has a word of his own for failures, and now and then another
        self._word = self._chance.by_weight(dict(figures.FAILING_NAMES))
        self._layout: List[_Slots] = []

    def machine(self) -> Box:
        """A program with a state or more for each container in it, and enough in all."""
        chance, sizes, parents = self._chance, [0], None
        count = chance.by_weight(dict(figures.CONTAINERS))
        while sum(sizes) < figures.LEAST_STATES or parents is None:
            sizes = [chance.by_weight(dict(figures.STATES)) for _ in range(count)]
            kinds = [MACHINE] + [self._kind(size) for size in sizes[1:]]
            parents = self._nest(sizes, kinds)
        self._layout = [
            _Slots(size, kind, inner) for size, kind, inner in zip(sizes, kinds, parents)
        ]
        return self._box(0, TOP, {})

    def _kind(self, size: int) -> str:
        drawn = self._chance.draw()
        if drawn < figures.CONCURRENT:
            return CONCURRENT if 2 <= size <= MOST_BRANCHES else MACHINE
        return ITERATED if drawn < figures.CONCURRENT + figures.ITERATED else MACHINE

    def _nest(self, sizes: List[int], kinds: List[str]) -> Optional[List[Dict[int, int]]]:
        """Which slot of an earlier container each lies in, or None where there is no room."""
        inner: List[Dict[int, int]] = [{} for _ in sizes]
        for child in range(1, len(sizes)):
            free = [
                (parent, slot)
                for parent in range(child)
                if kinds[parent] != CONCURRENT
                for slot in range(sizes[parent])
                if slot not in inner[parent]
            ]
            if not free:
                return None
            parent, slot = self._chance.one_of(free)
            inner[parent][slot] = child
        return inner

    # -- containers

    def _label(self, letter: str) -> str:
        self._number += 1
        return '{}{}'.format(letter, self._number)

    def _box(self, number: int, path: str, leads: Dict[str, str]) -> Box:
        layout = self._layout[number]
        if layout.kind == ITERATED:
            inside = self._states(layout, '{}/{}'.format(path, self._label('M')), {})
            items = 2 + int(self._chance.draw() * (MOST_ITEMS - 1))
            return Box(path, ITERATED, (inside,), inside.ends, leads, items)
        if layout.kind == CONCURRENT:
            branches = tuple(
                Leaf('{}/{}'.format(path, self._label('B')), (DONE,), ('aborted',), True, {})
                for _ in range(layout.size)
            )
            return Box(path, CONCURRENT, branches, ('aborted',), leads)
        return self._states(layout, path, leads)

    def _states(self, layout: _Slots, path: str, leads: Dict[str, str]) -> Box:
        loops = self._chance.happens(LOOPING)
        made = [
            self._box(layout.inner[slot], '{}/{}'.format(path, self._label('M')), {})
            if slot in layout.inner
            else self._leaf(path)
            for slot in range(layout.size)
        ]
        made = self._lay_aside(made)
        drawn = [self._lead(made, place, loops) for place in range(len(made))]
        children = tuple(node._replace(leads=each) for node, each in zip(made, drawn))
        labels = {child.label for child in children} | {DONE, PREEMPTED}
        ends = tuple(
            dict.fromkeys(
                end for child in children for end in child.leads.values() if end not in labels
            )
        )
        return Box(path, MACHINE, children, ends, leads)

    def _leaf(self, path: str) -> Leaf:
        work, failing, preempted = self._chance.by_weight(dict(figures.OUTCOMES))
        names = [self._failing_name(number) for number in range(failing)]
        return Leaf(
            '{}/{}'.format(path, self._label('S')),
            (DONE,) + MORE_NAMES[: work - 1],
            tuple(dict.fromkeys(names)),
            preempted > 0,
            {},
        )

    def _failing_name(self, number: int) -> str:
        if number == 0 and self._chance.happens(0.8):
            return self._word
        name = self._chance.by_weight(dict(figures.FAILING_NAMES))
        return name if number == 0 or name != self._word else 'failed_{}'.format(number)

    def _lay_aside(self, made: List[Node]) -> List[Node]:
        """Take some states out of the chain."""
        for place in range(1, len(made)):
            node, before = made[place], made[place - 1]
            if (
                isinstance(node, Leaf)
                and isinstance(before, Leaf)
                and before.failing
                and not before.is_aside
                and self._chance.happens(ASIDE)
            ):
                made[place] = node._replace(is_aside=True)
        return made

    # -- where outcomes lead

    def _lead(self, made: Sequence[Node], place: int, loops: bool) -> Dict[str, str]:
        node = made[place]
        onward = next((each.label for each in made[place + 1 :] if not each.is_aside), DONE)
        if isinstance(node, Box):
            leads = {DONE: onward, PREEMPTED: PREEMPTED}
            for end in node.ends:
                leads[end] = self._failing_lead(
                    made, place, end, _without_loops(MORE_FAILING, loops)
                )
            return leads
        leads = {node.work[0]: onward}
        if node.is_aside:
            leads[node.work[0]] = self._from_aside(made, place, onward, loops)
        for name in node.work[1:]:
            leads[name] = self._place(made, place, _without_loops(MORE_WORK, loops)) or DONE
        for name in node.failing:
            leads[name] = self._failing_lead(made, place, name, _without_loops(MORE_FAILING, loops))
        if node.failing and place + 1 < len(made) and made[place + 1].is_aside:
            leads[node.failing[0]] = made[place + 1].label
        if node.is_preemptable:
            leads[PREEMPTED] = PREEMPTED
        return leads

    def _from_aside(self, made: Sequence[Node], place: int, onward: str, loops: bool) -> str:
        lead = self._chance.by_weight(_without_loops(FROM_ASIDE, loops))
        if lead == 'on':
            return onward
        return made[place - 1].label if lead == 'back' else self._end(self._word)

    def _failing_lead(
        self, made: Sequence[Node], place: int, name: str, weights: Dict[str, float]
    ) -> str:
        return self._place(made, place, weights) or self._end(name)

    def _end(self, name: str) -> str:
        return name if self._chance.happens(figures.SAME_NAME) else 'aborted'

    def _place(self, made: Sequence[Node], place: int, weights: Dict[str, float]) -> str:
        """The label to which an outcome leads, '' where it leaves or has nowhere to go."""
        lead = self._chance.by_weight(weights)
        reached: Dict[str, Sequence[Node]] = {
            'next': made[place + 1 : place + 2],
            'forward': made[place + 2 :],
            'back': made[:place],
            'self': made[place : place + 1],
        }
        there = [each.label for each in reached.get(lead, ()) if not each.is_aside]
        return self._chance.one_of(there) if there else ''


def _without_loops(weights: Dict[str, float], loops: bool) -> Dict[str, float]:
    return {lead: weight for lead, weight in weights.items() if loops or lead not in WAYS_BACK}
