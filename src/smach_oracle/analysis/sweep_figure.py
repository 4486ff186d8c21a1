"""The figure of a memory sweep: share of trials with a question over the oracle's memory."""

from typing import Any, List, Mapping, Sequence

from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from .figure import BLACK, BLUE, COLUMN_IN, DPI, STYLE, VERMILLION

HEIGHT_IN = 2.4
GREEN = '#009E73'
LOOKS = ((BLUE, 'o', '-'), (VERMILLION, 's', '--'), (GREEN, '^', ':'), (BLACK, 'd', '-.'))


def save(series: Mapping[str, Sequence[Any]], stem: str) -> List[str]:
    """Draw the points of each series to `stem`.svg and `stem`.png, and return the paths.

    :raises OSError: where a file cannot be written.
    """
    with rc_context(STYLE):
        figure = draw(series)
        paths = [stem + '.svg', stem + '.png']
        # the same bags give the same file
        figure.savefig(paths[0], metadata={'Date': None, 'Creator': None})
        figure.savefig(paths[1], dpi=DPI, metadata={'Software': None})
    return paths


def draw(series: Mapping[str, Sequence[Any]]) -> Figure:
    """Draw shares with 95% Wilson intervals, by series.

    Series are shifted a little beside each other, so that none hides another.
    """
    figure = Figure(figsize=(COLUMN_IN[1], HEIGHT_IN))
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.14, 0.16, 0.84, 0.7))
    for number, (label, points) in enumerate(series.items()):
        colour, marker, dashes = LOOKS[number % len(LOOKS)]
        shift = 1.03 ** (number - (len(series) - 1) / 2)
        shares = [100 * point.asked.share for point in points]
        reach = [
            [share - 100 * point.asked.interval[0] for share, point in zip(shares, points)],
            [100 * point.asked.interval[1] - share for share, point in zip(shares, points)],
        ]
        axes.errorbar(
            [shift * point.memory for point in points],
            shares,
            yerr=reach,
            color=colour,
            marker=marker,
            linestyle=dashes,
            markersize=3.5,
            linewidth=1.2,
            elinewidth=0.8,
            capsize=2,
            label=label,
            clip_on=False,
        )
    memories = sorted({point.memory for points in series.values() for point in points})
    axes.set_xscale('log')
    axes.xaxis.set_major_locator(FixedLocator(memories))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xticklabels([str(memory) for memory in memories])
    axes.set_xlabel('Memory N (results of a state)')
    axes.set_ylabel('Trials with a question (%)')
    axes.set_ylim(bottom=0)
    axes.legend(
        loc='lower left',
        bbox_to_anchor=(0, 1.0),
        ncol=2,
        frameon=False,
        borderaxespad=0.0,
        borderpad=0.2,
    )
    return figure
