"""The paper's Fig. 6 and 8: oracle recoveries and expert assists over the trials."""

from typing import Any, Callable, Dict, List, NamedTuple, Sequence, Tuple

from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator

from .counting.trial_summary import TrialSummary
from .trial_counter import EXPERT_ANSWERED, TrialEnding, ended_otherwise

COLUMN_IN = {1: 3.5, 2: 7.16}  # widths of one and of two columns of an IEEE paper
HEIGHT_IN = {1: 3.5, 2: 3.3}
# what surrounds the axes
LEFT_IN, RIGHT_IN, BOTTOM_IN, LEGEND_ROW_IN, GAP_IN = 0.44, 0.1, 0.4, 0.15, 0.12
DPI = 300
# Okabe and Ito's palette: distinct with all common kinds of colour vision, and by their darkness
# in grey.
BLUE, VERMILLION, BLACK = '#0072B2', '#D55E00', '#000000'
GREEN = '#009E73'
STYLE = {
    'font.size': 7.5,
    'axes.labelsize': 8,
    'axes.titlesize': 8,
    'legend.fontsize': 7.5,
    'xtick.labelsize': 7,
    'ytick.labelsize': 7,
    'axes.linewidth': 0.6,
    'xtick.major.width': 0.6,
    'ytick.major.width': 0.6,
    'axes.spines.right': False,
    'axes.spines.top': False,
    'svg.hashsalt': 'smach_oracle',
    'svg.fonttype': 'path',
    'path.simplify': False,
}
_UNITS = ((7200.0, 3600.0, 'h'), (120.0, 60.0, 'min'), (0.0, 1.0, 's'))


class VariantSeries(NamedTuple):
    """The trials of one variant along the x axis."""

    trials: Tuple[TrialSummary, ...]
    x: Tuple[float, ...]  # of each trial
    x_end: float

    def steps(self, happened: Callable[[TrialSummary], bool]) -> Tuple[List[float], List[int]]:
        """Return the running count of trials in which it happened, as corners of a step line."""
        xs, ys = [0.0], [0]
        for x, trial in zip(self.x, self.trials):
            xs.append(x)
            ys.append(ys[-1] + bool(happened(trial)))
        return xs + [self.x_end], ys + [ys[-1]]


def save_time_series(
    trials: Sequence[TrialSummary], stem: str, columns: int = 1, x_axis: str = 'trials'
) -> List[str]:
    """Draw the trials of one experiment to `stem`.svg and `stem`.png, and return the paths.

    :param columns: 1 or 2, the width in columns of a paper.
    :param x_axis: 'trials' (number) or 'time' (since the variant's first trial began).
    :raises OSError: where a file cannot be written.
    """
    with rc_context(STYLE):
        figure = draw_time_series(trials, columns, x_axis)
        paths = [stem + '.svg', stem + '.png']
        # the same bags give the same file
        figure.savefig(paths[0], metadata={'Date': None, 'Creator': None})
        figure.savefig(paths[1], dpi=DPI, metadata={'Software': None})
    return paths


def draw_time_series(
    trials: Sequence[TrialSummary], columns: int = 1, x_axis: str = 'trials'
) -> Figure:
    """Draw events of trials with the oracle above, trials that needed help or failed below.

    The lower axes count the trials so far, in both variants. To be drawn and saved under
    `rc_context(STYLE)`: matplotlib makes ticks only when it draws.
    """
    unit_s, unit = _time_unit(trials)
    variants = {
        recovers: _variant_series(trials, recovers, x_axis, unit_s) for recovers in (True, False)
    }
    figure = Figure(figsize=(COLUMN_IN[columns], HEIGHT_IN[columns]))
    FigureCanvasAgg(figure)
    above, below = _make_axes(figure, (1, 3 - columns))
    width_pt = 72 * (figure.get_figwidth() - LEFT_IN - RIGHT_IN)
    _draw_events(above, variants[True], width_pt)
    _draw_needed(below, variants, legend_columns=2 * columns)
    for axes in (above, below):
        axes.set_xlim(0, max([variant.x_end for variant in variants.values()] + [1e-9]))
        axes.xaxis.set_major_locator(
            MaxNLocator(nbins=4 + 4 * columns, integer=x_axis == 'trials', steps=(1, 2, 2.5, 5, 10))
        )
    above.tick_params(labelbottom=False)
    below.set_xlabel('Trial' if x_axis == 'trials' else 'Elapsed time ({})'.format(unit))
    return figure


def _make_axes(figure: Figure, legend_rows: Tuple[int, int]) -> List[Any]:
    """Two axes of the same size, each with room for its legend above.

    Fixed margins align figures with each other.
    """
    width, height = figure.get_figwidth(), figure.get_figheight()
    axes_height = (height - BOTTOM_IN - GAP_IN - 0.05 - LEGEND_ROW_IN * sum(legend_rows)) / 2
    bottoms = (height - 0.05 - LEGEND_ROW_IN * legend_rows[0] - axes_height, BOTTOM_IN)
    made = []
    for letter, bottom in zip('ab', bottoms):
        axes = figure.add_axes(
            (
                LEFT_IN / width,
                bottom / height,
                (width - LEFT_IN - RIGHT_IN) / width,
                axes_height / height,
            )
        )
        axes.yaxis.set_label_coords(-0.27 / (width - LEFT_IN - RIGHT_IN), 0.5)
        axes.text(
            -0.95 * LEFT_IN / (width - LEFT_IN - RIGHT_IN),
            1.0,
            '({})'.format(letter),
            transform=axes.transAxes,
            va='bottom',
            fontsize=8,
        )
        made.append(axes)
    return made


def _variant_series(
    trials: Sequence[TrialSummary], recovers: bool, x_axis: str, unit_s: float
) -> VariantSeries:
    chosen = tuple(trial for trial in trials if trial.recovers is recovers)
    if not chosen:
        return VariantSeries((), (), 0.0)
    if x_axis == 'trials':
        return VariantSeries(
            chosen, tuple(float(number) for number in range(1, len(chosen) + 1)), len(chosen) + 1.0
        )
    first = chosen[0].start_time
    ends = [(trial.start_time + trial.duration_s - first) / unit_s for trial in chosen]
    return VariantSeries(chosen, tuple(ends), max(ends))


def _time_unit(trials: Sequence[TrialSummary]) -> Tuple[float, str]:
    """The unit that suits the longest variant: its seconds, its symbol."""
    spans = [0.0]
    for recovers in (True, False):
        chosen = [trial for trial in trials if trial.recovers is recovers]
        if chosen:
            spans.append(
                max(trial.start_time + trial.duration_s for trial in chosen) - chosen[0].start_time
            )
    return next((unit_s, name) for least, unit_s, name in _UNITS if max(spans) >= least)


def _draw_events(axes: Any, variant: VariantSeries, axes_width_pt: float) -> None:
    bar_pt = min(4.0, max(1.0, 0.7 * axes_width_pt / max(1, len(variant.trials))))
    for sign, colour, label, number in (
        (1, BLUE, 'oracle recoveries', lambda trial: trial.recoveries),
        (-1, VERMILLION, 'expert answers', lambda trial: trial.answered),
    ):
        bars = [(x, number(trial)) for x, trial in zip(variant.x, variant.trials) if number(trial)]
        axes.vlines(
            [x for x, _ in bars],
            0,
            [sign * height for _, height in bars],
            colors=colour,
            linewidths=bar_pt,
        )
        axes.plot([], [], color=colour, linewidth=3.0, label=label)  # the legend's patch
    if not variant.trials:
        axes.text(
            0.5,
            0.5,
            'no trials with the oracle',
            transform=axes.transAxes,
            ha='center',
            va='bottom',
        )
    axes.axhline(0, color=BLACK, linewidth=0.6)
    axes.set_ylabel('Events per trial')
    axes.set_ylim(
        -max([1] + [trial.answered for trial in variant.trials]) - 0.3,
        max([1] + [trial.recoveries for trial in variant.trials]) + 0.3,
    )
    axes.yaxis.set_major_locator(MaxNLocator(nbins=6, integer=True))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: '{:g}'.format(abs(value))))
    _legend_above(axes, columns=2)


def _draw_needed(axes: Any, variants: Dict[bool, VariantSeries], legend_columns: int) -> None:
    series = (
        (True, BLUE, '-', 1.8, 'with an oracle recovery', lambda trial: trial.recoveries > 0),
        (True, VERMILLION, '-', 1.8, EXPERT_ANSWERED, lambda trial: trial.answered > 0),
        (
            True,
            BLACK,
            (0, (1, 1)),
            1.2,
            'failed, with oracle',
            lambda trial: trial.ending is TrialEnding.FAILURE,
        ),
        *_other_ends(variants),
        (
            False,
            BLACK,
            (0, (3, 1.5)),
            0.9,
            'failed, without oracle',
            lambda trial: trial.ending is TrialEnding.FAILURE,
        ),
    )
    highest = 1
    for recovers, colour, dashes, width_pt, label, happened in series:
        if variants[recovers].trials:
            xs, ys = variants[recovers].steps(happened)
            axes.step(
                xs,
                ys,
                where='post',
                color=colour,
                linestyle=dashes,
                linewidth=width_pt,
                label=label,
            )
            highest = max(highest, ys[-1])
    axes.set_ylim(0, 1.05 * highest)
    axes.yaxis.set_major_locator(MaxNLocator(nbins=5, integer=True, steps=(1, 2, 5, 10)))
    axes.set_ylabel('Trials (cumulative)')
    _legend_above(axes, legend_columns)


def _other_ends(variants: Dict[bool, VariantSeries]) -> List[Any]:
    """Return the lines of trials whose ends say neither success nor failure, where there are."""
    lines = (
        (True, GREEN, (0, (1, 1)), 1.2, 'other end, with oracle', ended_otherwise),
        (False, GREEN, (0, (3, 1.5)), 0.9, 'other end, without oracle', ended_otherwise),
    )
    return [line for line in lines if any(map(ended_otherwise, variants[line[0]].trials))]


def _legend_above(axes: Any, columns: int) -> None:
    """Outside the axes, so that it can cover no data."""
    if axes.get_legend_handles_labels()[1]:
        axes.legend(
            loc='lower left',
            bbox_to_anchor=(0, 1.0),
            ncol=columns,
            frameon=False,
            borderaxespad=0.0,
            borderpad=0.2,
            labelspacing=0.25,
            handlelength=1.6,
            columnspacing=1.2,
            handletextpad=0.5,
        )
