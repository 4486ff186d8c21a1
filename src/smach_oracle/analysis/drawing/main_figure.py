"""The main table as a figure: shares of the variants, with their intervals."""

from typing import Dict, List, Mapping, Sequence, Tuple

from matplotlib.figure import Figure
from matplotlib.patches import Patch

from ..comparison import by_variant, with_hindsight
from ..figure import BLACK, BLUE, VERMILLION
from ..pairing import HINDSIGHT
from ..sweep_figure import GREEN
from ..trial_counter import PERSON_NEEDED
from ..trial_rows import TrialRow
from .looks import Happened, Percent, legend_above, panels
from .titles import tasks_of, title_of

SHOWN: Tuple[Tuple[str, str, str, Happened], ...] = (
    ('true success', BLUE, 'o', lambda row: row.succeeded),
    (PERSON_NEEDED, VERMILLION, 's', lambda row: row.intervened),
    ('question', BLACK, 'd', lambda row: row.questions > 0),
    ('recovered', GREEN, '^', lambda row: row.recovered),
)
APART = 0.17  # of a line's height, from one share's marker to the next
PALE = 0.3  # of the bars of replicates
LINE_IN, FRAME_IN = 0.32, 0.95
LETTER = 0.0076  # of the figure's width, in the name of a variant


def draw_main(rows: Sequence[TrialRow]) -> Figure:
    """Draw a line for each variant and a panel for each task, over all trials of the variant.

    A pale bar goes from the smallest to the largest share of a replicate.
    """
    return _draw(
        {task: by_variant([row for row in rows if row.task == task]) for task in tasks_of(rows)}, {}
    )


def draw_same_seeds(rows: Sequence[TrialRow]) -> Figure:
    """Draw the same over the seeds that all variants of a task ran, with the bound of hindsight."""
    found = same_seeds(rows)
    return _draw(
        found,
        {
            task: '{} seeds that all ran'.format(len(variants[HINDSIGHT]))
            for task, variants in found.items()
        },
    )


def same_seeds(rows: Sequence[TrialRow]) -> Dict[str, Dict[str, List[TrialRow]]]:
    """Return the rows of draw_same_seeds() by task and variant, for tasks that have such."""
    found = {
        task: with_hindsight([row for row in rows if row.task == task]) for task in tasks_of(rows)
    }
    return {task: variants for task, variants in found.items() if variants}


def _draw(tasks: Mapping[str, Mapping[str, Sequence[TrialRow]]], told: Mapping[str, str]) -> Figure:
    """Draw the panels. Markers stand below each other, so that none hides another.

    :param told: what stands behind a task's title.
    """
    names = _in_order(tasks)
    labels = [name.replace('_', ' ').replace(':', ': ') for name in names]
    height_in = FRAME_IN + LINE_IN * len(names)
    titles = [
        ', '.join([title_of(task), *([told[task]] if task in told else [])]) for task in tasks
    ]
    figure, (made,) = panels(
        titles,
        height_in,
        margins=dict(
            left=max(0.11, 0.03 + LETTER * max(map(len, labels))),
            top=1 - 0.5 / height_in,
            bottom=0.38 / height_in,
            wspace=0.09,
        ),
    )
    for axes, variants in zip(made, tasks.values()):
        for line, name in enumerate(names):
            chosen = variants.get(name, ())
            for number, (label, colour, marker, happened) in enumerate(SHOWN if chosen else ()):
                percent = Percent(chosen, happened)
                low, high = percent.reach
                height = line + APART * (number - (len(SHOWN) - 1) / 2)
                if percent.replicates:
                    axes.hlines(
                        [height],
                        *percent.replicates,
                        color=colour,
                        linewidth=4.0,
                        alpha=PALE,
                        label='replicates',
                    )
                axes.errorbar(
                    [percent.share],
                    [height],
                    xerr=[[low], [high]],
                    color=colour,
                    marker=marker,
                    linestyle='none',
                    markersize=3.5,
                    elinewidth=0.8,
                    capsize=1.5,
                    clip_on=False,
                    label=label if line == 0 else None,
                )
        axes.set_xlim(0, 100)
        axes.set_ylim(len(names) - 0.5, -0.5)
        axes.set_yticks(range(len(names)))
        axes.set_yticklabels(labels if axes is made[0] else [])
        axes.set_xlabel('Trials (%)')
        axes.grid(axis='x', linewidth=0.3)
    several = any(
        len({row.replicate for row in rows}) > 1
        for variants in tasks.values()
        for rows in variants.values()
    )
    legend_above(
        figure,
        made[0],
        [label for label, *_ in SHOWN],
        [(Patch(color=BLACK, alpha=PALE, linewidth=0), 'replicates')] if several else [],
    )
    return figure


def _in_order(tasks: Mapping[str, Mapping[str, Sequence[TrialRow]]]) -> List[str]:
    """Return the names of all variants, as they were begun, HINDSIGHT last."""
    names = list(dict.fromkeys(name for variants in tasks.values() for name in variants))
    return sorted(names, key=lambda name: name == HINDSIGHT)
