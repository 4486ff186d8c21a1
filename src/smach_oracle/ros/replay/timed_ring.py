"""Keeps the newest items of a stream, bounded in seconds and in bytes."""

from collections import deque
from typing import Deque, Generic, List, Tuple, TypeVar

Item = TypeVar('Item')


class TimedRing(Generic[Item]):
    """The newest items. It is not thread-safe.

    Where the clock jumps back (a simulation that begins again), the items of before are dropped.
    """

    def __init__(self, seconds: float, most_bytes: int) -> None:
        """
        :param seconds: how much older than the newest item one may be.
        :param most_bytes: of all items together.
        """
        self._seconds = seconds
        self._most_bytes = most_bytes
        self._kept: Deque[Tuple[float, int, Item]] = deque()  # stamp in s, size
        self.bytes = 0

    def __len__(self) -> int:
        return len(self._kept)

    def put(self, stamp_s: float, size: int, item: Item) -> bool:
        """Keep an item, and forget what is too old or too much.

        :param stamp_s: when it came.
        :param size: of the item, in bytes.
        :returns: False for one that is larger than the ring, and is not kept.
        """
        self.forget_before(stamp_s)
        if size > self._most_bytes:
            return False
        self._kept.append((stamp_s, size, item))
        self.bytes += size
        while self.bytes > self._most_bytes:
            self._drop_oldest()
        return True

    def forget_before(self, now_s: float) -> None:
        """Forget what is too old at a moment, or lies after it."""
        if self._kept and self._kept[-1][0] > now_s:
            self._kept.clear()
            self.bytes = 0
        while self._kept and self._kept[0][0] < now_s - self._seconds:
            self._drop_oldest()

    def items(self) -> List[Item]:
        """Return what is kept, oldest first."""
        return [item for _, _, item in self._kept]

    def _drop_oldest(self) -> None:
        self.bytes -= self._kept.popleft()[1]
