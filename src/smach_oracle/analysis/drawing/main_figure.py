"""The main table as a figure: shares of the variants, with their intervals."""
from typing import List, Sequence, Tuple

from matplotlib.figure import Figure

from ..figure import BLACK, BLUE, VERMILLION
from ..pairing import HINDSIGHT, hindsight
from ..sweep_figure import GREEN
from ..trial_rows import TrialRow
from .looks import Happened, Percent, legend_above, panels, tasks_of, title_of, variants_of

SHOWN: Tuple[Tuple[str, str, str, Happened], ...] = (
    ('true success', BLUE, 'o', lambda row: row.succeeded),
    ('intervention', VERMILLION, 's', lambda row: row.intervened),
    ('question', BLACK, 'd', lambda row: row.questions > 0),
    ('recovered', GREEN, '^', lambda row: row.recovered),
)
APART = 0.17  # of a line's height, from one share's marker to the next
LINE_IN, FRAME_IN = 0.32, 0.95


def draw_main(rows: Sequence[TrialRow]) -> Figure:
    """Draw a line for each variant and a panel for each task.

    Markers stand below each other, so that none hides another.
    """
    tasks = tasks_of(rows)
    names = _names(rows)
    height_in = FRAME_IN + LINE_IN * len(names)
    figure, (made,) = panels([title_of(task) for task in tasks], height_in, margins=dict(
        left=0.11, top=1 - 0.5 / height_in, bottom=0.38 / height_in, wspace=0.06))
    for axes, task in zip(made, tasks):
        mine = [row for row in rows if row.task == task]
        best = hindsight(mine)
        for line, name in enumerate(names):
            chosen = best if name == HINDSIGHT else [row for row in mine if row.variant == name]
            for number, (label, colour, marker, happened) in enumerate(SHOWN if chosen else ()):
                percent = Percent(chosen, happened)
                low, high = percent.reach
                axes.errorbar(
                    [percent.share], [line + APART * (number - (len(SHOWN) - 1) / 2)],
                    xerr=[[low], [high]], color=colour, marker=marker, linestyle='none',
                    markersize=3.5, elinewidth=0.8, capsize=1.5, clip_on=False,
                    label=label if line == 0 else None)
        axes.set_xlim(0, 100)
        axes.set_ylim(len(names) - 0.5, -0.5)
        axes.set_yticks(range(len(names)))
        axes.set_yticklabels([name.replace('_', ' ') for name in names] if axes is made[0] else [])
        axes.set_xlabel('Trials (%)')
        axes.grid(axis='x', linewidth=0.3)
    legend_above(figure, made[0])
    return figure


def _names(rows: Sequence[TrialRow]) -> List[str]:
    names = variants_of(rows)
    return names + [HINDSIGHT] if len(names) > 1 else names
