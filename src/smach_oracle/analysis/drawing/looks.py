"""The looks of an experiment's figures: sizes, colours, and how a file is written."""

from pathlib import Path
from typing import Any, Callable, Dict, List, Optional, Sequence, Tuple

from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ..figure import BLACK, BLUE, COLUMN_IN, DPI, STYLE, VERMILLION
from ..intervals import Interval, wilson_interval
from ..sweep_figure import GREEN
from ..trial_rows import TrialRow

# a variant looks the same in all figures: colour, marker, dashes
LOOKS: Dict[str, Tuple[str, str, str]] = {
    'bare': (BLACK, 'd', '-.'),
    'default': (BLUE, 'o', '-'),
    'restart': (VERMILLION, 's', '--'),
}
OTHERS = (GREEN, '^', ':')
Happened = Callable[[TrialRow], bool]


def look_of(variant: str) -> Tuple[str, str, str]:
    """Return the colour, marker and dashes of a variant."""
    return LOOKS.get(variant, OTHERS)


class Percent:
    """A share of trials with its 95% Wilson interval, in percent."""

    def __init__(self, rows: Sequence[TrialRow], happened: Happened) -> None:
        """Count."""
        number = sum(map(happened, rows))
        self.share = 100.0 * number / len(rows)
        low, high = wilson_interval(number, len(rows))
        self.interval: Interval = (100 * low, 100 * high)
        parts: Dict[int, List[bool]] = {}
        for row in rows:
            parts.setdefault(row.replicate, []).append(happened(row))
        shares = [100.0 * sum(part) / len(part) for part in parts.values()]
        # the smallest and the largest of a replicate. None means there are no two
        self.replicates: Optional[Interval] = (
            (min(shares), max(shares)) if len(shares) > 1 else None
        )

    @property
    def reach(self) -> Tuple[float, float]:
        """Return how far the interval goes below and above."""
        return max(0.0, self.share - self.interval[0]), max(0.0, self.interval[1] - self.share)


def panels(
    titles: Sequence[str],
    height_in: float,
    rows: int = 1,
    margins: Optional[Dict[str, float]] = None,
) -> Tuple[Figure, List[List[Any]]]:
    """Return a figure as wide as two columns of a paper, with axes row by row.

    :param titles: one for each column.
    :param margins: of matplotlib's subplots_adjust.
    """
    figure = Figure(figsize=(COLUMN_IN[2], height_in))
    FigureCanvasAgg(figure)
    made = [
        [
            figure.add_subplot(rows, len(titles), 1 + row * len(titles) + column)
            for column in range(len(titles))
        ]
        for row in range(rows)
    ]
    for axes, title in zip(made[0], titles):
        axes.set_title(title, loc='left')
    figure.subplots_adjust(
        **{**dict(left=0.08, right=0.98, bottom=0.17, top=0.80, wspace=0.22), **(margins or {})}
    )
    return figure, made


def legend_above(
    figure: Figure, axes: Any, shown: Sequence[str] = (), more: Sequence[Tuple[Any, str]] = ()
) -> None:
    """Put the legend of some axes above all, where it covers no data.

    :param shown: its labels. None are all.
    :param more: further entries: what is drawn, and its label.
    """
    found = [
        (handle, label)
        for handle, label in zip(*axes.get_legend_handles_labels())
        if label in (shown or (label,))
    ] + list(more)
    figure.legend(
        [handle for handle, _ in found],
        [label for _, label in found],
        loc='upper center',
        ncol=6,
        frameon=False,
        borderpad=0.2,
        columnspacing=1.4,
    )


def save(draw: Callable[[], Figure], stem: Path) -> List[Path]:
    """Draw a figure to STEM.svg and STEM.png. The same rows give the same files.

    :raises OSError: where a file cannot be written.
    """
    paths = [stem.with_suffix('.svg'), stem.with_suffix('.png')]
    with rc_context(STYLE):
        figure = draw()
        figure.savefig(str(paths[0]), metadata={'Date': None, 'Creator': None})
        figure.savefig(str(paths[1]), dpi=DPI, metadata={'Software': None})
    return paths
