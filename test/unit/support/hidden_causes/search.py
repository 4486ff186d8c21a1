"""The best order of simple ways, for somebody who knows the mix of causes but not the cause."""

from typing import Callable, Dict, Iterator, NamedTuple, Tuple

from .orders import ASK, GIVE_UP

TRIED = ('retry', 'wait', 'step_back', 'restart')
LONGEST = 5  # ways of an order, with its end

Order = Tuple[str, ...]


class Found(NamedTuple):
    """The best order, what it costs, and how many orders were tried."""

    order: Order
    cost: float
    tried: int


def best_order(cost: Callable[[Order], float]) -> Found:
    """Search step by step: from no way, to the cheapest change of one way, until none helps.

    A change adds a way at any place, leaves one out, puts another in its place, or ends the order
    otherwise, by asking or by giving up. It is a search and no proof: an order that differs in two
    ways may be cheaper still.
    """
    costs: Dict[Order, float] = {}

    def known(order: Order) -> float:
        if order not in costs:
            costs[order] = cost(order)
        return costs[order]

    best = min(((ASK,), (GIVE_UP,)), key=known)
    while True:
        nearest = min(_changes(best), key=known)
        if known(nearest) >= known(best):
            return Found(best, known(best), len(costs))
        best = nearest


def _changes(order: Order) -> Iterator[Order]:
    """All orders that differ in one way."""
    ways, end = order[:-1], order[-1:]
    for place in range(len(ways) + 1):
        for way in TRIED:
            if len(order) < LONGEST:
                yield ways[:place] + (way,) + ways[place:] + end
            if place < len(ways):
                yield ways[:place] + (way,) + ways[place + 1 :] + end
        if place < len(ways):
            yield ways[:place] + ways[place + 1 :] + end
    yield ways + ((GIVE_UP,) if end == (ASK,) else (ASK,))
