"""The time series: what is drawn is what was counted, and nothing is covered."""

import xml.etree.ElementTree as ElementTree

import pytest
from test_table import trial

from smach_oracle.analysis import figure
from smach_oracle.analysis.trial_counter import TrialEnding


@pytest.fixture(autouse=True)
def style():
    with figure.rc_context(figure.STYLE):
        yield


def trials(count=40):
    made = []
    for recovers in (True, False):
        for number in range(count):
            fails = number % 4 == 1
            made.append(
                trial(
                    number,
                    recovers=recovers,
                    start_time=480.0 * number,
                    duration_s=400.0,
                    recoveries=(number % 3 + 1) if fails and recovers else 0,
                    answered=int(number % 16 == 5 and recovers),
                    questions=int(number % 16 == 5),
                    ending=TrialEnding.FAILURE
                    if fails and (not recovers or number == 37)
                    else TrialEnding.SUCCESS,
                )
            )
    return made


def lines(axes):
    return {
        line.get_label(): line for line in axes.get_lines() if not line.get_label().startswith('_')
    }


def bars(axes, colour):
    """(x, height) of the bars of a colour."""
    from matplotlib.colors import to_rgba

    (found,) = [item for item in axes.collections if tuple(item.get_color()[0]) == to_rgba(colour)]
    return [(segment[0][0], segment[1][1] - segment[0][1]) for segment in found.get_segments()]


def test_the_bars_are_the_counts_of_each_trial():
    drawn = figure.draw_time_series(trials())
    above = drawn.axes[0]
    assert bars(above, figure.BLUE) == [
        (number + 1, number % 3 + 1) for number in range(40) if number % 4 == 1
    ]
    assert bars(above, figure.VERMILLION) == [
        (number + 1, -1) for number in range(40) if number % 16 == 5
    ]


def test_the_steps_end_at_the_tables_counts():
    below = figure.draw_time_series(trials()).axes[1]
    ends = {label: line.get_ydata()[-1] for label, line in lines(below).items()}
    assert ends == {
        'failed, without oracle': 10,
        'failed, with oracle': 1,
        'with an oracle recovery': 10,
        'expert answered': 3,
    }


def test_time_instead_of_trials_has_a_unit_that_suits():
    drawn = figure.draw_time_series(trials(), x_axis='time')
    assert drawn.axes[1].get_xlabel() == 'Elapsed time (h)'
    assert drawn.axes[1].get_xlim() == (0, pytest.approx((480.0 * 39 + 400.0) / 3600.0))
    quick = [item._replace(start_time=item.start_time / 480.0, duration_s=0.5) for item in trials()]
    assert figure.draw_time_series(quick, x_axis='time').axes[1].get_xlabel() == 'Elapsed time (s)'


@pytest.mark.parametrize('columns, width_in', [(1, 3.5), (2, 7.16)])
def test_nothing_is_cut_off_or_covered(columns, width_in):
    drawn = figure.draw_time_series(trials(), columns)
    assert drawn.get_figwidth() == width_in
    drawn.canvas.draw()
    renderer = drawn.canvas.get_renderer()
    inside = drawn.bbox
    for axes in drawn.axes:
        whole = axes.get_tightbbox(renderer)
        assert whole.x0 >= inside.x0 and whole.y0 >= inside.y0
        assert whole.x1 <= inside.x1 and whole.y1 <= inside.y1
        assert (
            axes.get_legend().get_window_extent(renderer).y0
            >= axes.get_window_extent(renderer).y1 - 0.5
        )
    upper, lower = drawn.axes
    assert upper.get_window_extent(renderer).y0 > lower.get_legend().get_window_extent(renderer).y1


def test_text_is_large_enough_for_print():
    drawn = figure.draw_time_series(trials())
    sizes = [
        text.get_fontsize()
        for axes in drawn.axes
        for text in axes.get_xticklabels() + axes.get_yticklabels() + axes.get_legend().get_texts()
    ]
    assert min(sizes) >= 7.0


@pytest.mark.parametrize(
    'recovers, expected',
    [
        (True, {'with an oracle recovery', 'expert answered', 'failed, with oracle'}),
        (False, {'failed, without oracle'}),
    ],
)
def test_one_variant_alone_can_be_drawn(recovers, expected):
    drawn = figure.draw_time_series([item for item in trials() if item.recovers is recovers])
    assert set(lines(drawn.axes[1])) == expected
    drawn.canvas.draw()


def test_a_single_trial_can_be_drawn():
    drawn = figure.draw_time_series([trial(0)], x_axis='time')
    drawn.canvas.draw()
    assert {max(line.get_ydata()) for line in lines(drawn.axes[1]).values()} <= {0, 1}
    assert set(lines(drawn.axes[1])) == {
        'with an oracle recovery',
        'expert answered',
        'failed, with oracle',
    }


def test_svg_and_png_are_written_and_do_not_differ_from_run_to_run(tmp_path):
    written = []
    for run in range(2):
        paths = figure.save_time_series(trials(), str(tmp_path / str(run)))
        assert [path.rsplit('.', 1)[1] for path in paths] == ['svg', 'png']
        written.append([open(path, 'rb').read() for path in paths])
    assert written[0] == written[1]
    assert ElementTree.fromstring(written[0][0]).get('width') == '252pt'  # 3.5 in
    assert written[0][1][:8] == b'\x89PNG\r\n\x1a\n'
    width = int.from_bytes(written[0][1][16:20], 'big')
    assert width == 1050  # 3.5 in at 300 dpi
