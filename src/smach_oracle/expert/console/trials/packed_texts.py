"""Many lines of text in little memory: all but the latest are compressed. Pure."""

import zlib
from typing import List

IN_A_PACK = 64  # lines; the events of a trial, which are alike, take a tenth of their length


class PackedTexts:
    """Lines in their order; no line has a line break in it."""

    def __init__(self) -> None:
        self._packs: List[bytes] = []  # each of IN_A_PACK lines
        self._latest: List[str] = []
        self.size = 0  # bytes of the packs, and characters of the latest lines

    def __len__(self) -> int:
        return len(self._packs) * IN_A_PACK + len(self._latest)

    def append(self, line: str) -> None:
        """Add a line at the end."""
        self._latest.append(line)
        self.size += len(line)
        if len(self._latest) == IN_A_PACK:
            pack = zlib.compress('\n'.join(self._latest).encode())
            self.size += len(pack) - sum(map(len, self._latest))
            self._packs.append(pack)
            self._latest = []

    def lines(self, start: int, most: int) -> List[str]:
        """Return up to `most` lines from a position on, which counts from 0."""
        first = min(start // IN_A_PACK, len(self._packs))
        found: List[str] = []
        for pack in self._packs[first : -(-(start + most) // IN_A_PACK)]:
            found += zlib.decompress(pack).decode().split('\n')
        begin = start - first * IN_A_PACK
        return (found + self._latest)[begin : begin + most]

    def clear(self) -> None:
        """Forget all lines."""
        self._packs, self._latest, self.size = [], [], 0
