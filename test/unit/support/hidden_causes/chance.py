"""Chance that depends on names alone, so that whatever else happens changes no draw."""

import math
from hashlib import blake2b
from typing import Dict, Sequence, TypeVar

Item = TypeVar('Item')


def drawn(*names: object) -> float:
    """Return a number from 0 to 1, without 1, always the same for the same names."""
    text = ' '.join(map(str, names)).encode()
    return int.from_bytes(blake2b(text, digest_size=7).digest(), 'big') / 2.0**56


def exponential(mean: float, *names: object) -> float:
    """Return a number with an exponential distribution."""
    return -mean * math.log(1.0 - drawn(*names))


class Chance:
    """One draw after the other, for what is drawn once and in one order."""

    def __init__(self, *names: object) -> None:
        self._names = names
        self._number = 0

    def draw(self) -> float:
        """Return a number from 0 to 1, without 1."""
        self._number += 1
        return drawn(*self._names, self._number)

    def happens(self, chance: float) -> bool:
        """Whether something of this chance happens."""
        return self.draw() < chance

    def one_of(self, items: Sequence[Item]) -> Item:
        """Return one of the items, each as likely."""
        return items[int(self.draw() * len(items))]

    def by_weight(self, weights: Dict[Item, float]) -> Item:
        """Return one of the keys, as likely as its weight says."""
        left = self.draw() * sum(weights.values())
        for item, weight in weights.items():
            left -= weight
            if left < 0:
                return item
        return item

    def between(self, low: float, high: float) -> float:
        """Return a number between two, each as likely."""
        return low + (high - low) * self.draw()

    def magnitude(self, low: float, high: float) -> float:
        """Return a number between two, each order of magnitude as likely."""
        return math.exp(self.between(math.log(low), math.log(high)))

    def steps(self, stop: float) -> int:
        """Return how many steps are made where each may be the last, at least 1."""
        count = 1
        while not self.happens(stop):
            count += 1
        return count
