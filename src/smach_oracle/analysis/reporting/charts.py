"""Geometry of small charts: steps of shares over a length. Pure."""

from typing import List, NamedTuple, Sequence, Tuple

WIDTH, HEIGHT = 300.0, 178.0  # of a chart, in units of its view box
LEFT, RIGHT, TOP, BOTTOM = 40.0, 12.0, 10.0, 36.0  # around its axes
_STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)
_TICKS = 5
Corner = Tuple[float, float]  # a length, and a share from 0 to 1


class Tick(NamedTuple):
    """A mark of an axis."""

    at: float
    text: str


class Axes(NamedTuple):
    """The axes of a chart whose lengths go from `first` to `last`."""

    first: float
    last: float
    right: float = WIDTH - RIGHT  # where they end

    def x(self, length: float) -> float:
        """Return where a length lies."""
        span = self.last - self.first or 1.0
        inside = min(1.0, max(0.0, (length - self.first) / span))
        return round(LEFT + inside * (self.right - LEFT), 2)

    def y(self, share: float) -> float:
        """Return where a share lies."""
        inside = min(1.0, max(0.0, share))
        return round(HEIGHT - BOTTOM - inside * (HEIGHT - TOP - BOTTOM), 2)

    def line(self, corners: Sequence[Corner]) -> str:
        """Return the path through some corners."""
        return 'M' + 'L'.join('{:g},{:g}'.format(self.x(x), self.y(y)) for x, y in corners)

    def area(self, above: Sequence[Corner], below: Sequence[Corner]) -> str:
        """Return the path around what lies between two lines."""
        return self.line([*above, *reversed(below)]) + 'Z'

    def x_ticks(self, whole: bool) -> List[Tick]:
        """Return the marks of lengths. `whole`: those of whole numbers alone."""
        return [
            Tick(self.x(each), '{:g}'.format(each)) for each in ticks(self.first, self.last, whole)
        ]

    def y_ticks(self) -> List[Tick]:
        """Return the marks of shares."""
        return [Tick(self.y(each / 4), '{}%'.format(25 * each)) for each in range(5)]


def ticks(first: float, last: float, whole: bool) -> List[float]:
    """Return round numbers from `first` to `last`, about five of them."""
    span = last - first
    if not span > 0:
        return [first]
    power = 1.0
    while power * 10 * _TICKS < span:
        power *= 10
    while power * _TICKS > span:
        power /= 10
    step = next((power * each for each in _STEPS if span / (power * each) <= _TICKS), power * 10)
    if whole:
        step = max(1.0, float(round(step)))
    begin = int(first / step)
    found = [round(step * number, 10) for number in range(begin, begin + 2 * _TICKS + 4)]
    return [each for each in found if first <= each <= last + 1e-9 * span]


def stepped(points: Sequence[Corner], first: Corner, last: float) -> List[Corner]:
    """Return the corners of a line that keeps each value until the next one.

    :param first: where it begins.
    :param last: the length at which it ends.
    """
    corners = [first]
    for x, y in points:
        corners += [(x, corners[-1][1]), (x, y)]
    return [*corners, (max(last, corners[-1][0]), corners[-1][1])]
