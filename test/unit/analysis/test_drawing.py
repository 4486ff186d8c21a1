"""The figures and tables of an experiment, drawn from its rows alone."""

import json

import pytest
from matplotlib import rc_context

from smach_oracle.analysis.comparison import (
    costs_of,
    format_comparison,
    robot_hours,
    shares_of,
    with_hindsight,
)
from smach_oracle.analysis.drawing import command
from smach_oracle.analysis.drawing.hours_figure import draw_hours, learned_rates
from smach_oracle.analysis.drawing.main_figure import draw_main, draw_same_seeds
from smach_oracle.analysis.drawing.sweep_figures import draw_memory, draw_persistence
from smach_oracle.analysis.drawing.sweep_tables import format_sweeps
from smach_oracle.analysis.drawing.tables import format_tables
from smach_oracle.analysis.figure import STYLE
from smach_oracle.analysis.intervals import wilson_interval
from smach_oracle.analysis.trial_rows import TrialRow, append_rows

LEARNED = json.dumps(
    {
        '': {
            'PICK': {'estimator': 'window', 'failures': 2, 'successes': 2, 'window': [0, 1, 0, 1]},
            'PLACE': {'estimator': 'exponential', 'failures': 1, 'successes': 3, 'rate': 0.15},
            'LOOK': {'estimator': 'window', 'failures': 0, 'successes': 4, 'window': [0, 0, 0, 0]},
        }
    }
)


def rows_of(variant, asked, count=10, **more):
    """So many trials, of which the first ones had a question."""
    return [
        TrialRow(
            **{
                **dict(
                    task='pick_and_place',
                    variant=variant,
                    replicate=0,
                    seed=7 + number,
                    ending='success',
                    true_success=True,
                    wrong_object='',
                    damage=0,
                    questions=int(number < asked),
                    expert_s=0.0,
                    sim_s=60.0,
                ),
                **more,
            }
        )
        for number in range(count)
    ]


def errorbars(axes):
    """What errorbar has drawn: by label, x and y of the points and their intervals."""
    return {
        bars.get_label(): (
            bars.lines[0].get_xdata(),
            bars.lines[0].get_ydata(),
            [line.get_segments() for line in bars.lines[2]],
        )
        for bars in axes.containers
    }


def cells_of(text):
    """Markdown tables, each by the first cell of its lines."""
    found, before = [], ''
    for line in text.splitlines():
        cells = [cell.strip() for cell in line.strip('|').split('|')]
        if line.startswith('|') and not before.startswith('|'):
            found.append({})
        if line.startswith('|') and cells[-1] != '---':
            found[-1][cells[0]] = cells[1:]
        before = line
    return found


def test_the_main_figure_has_each_share_with_its_interval_and_hides_none():
    rows = rows_of('bare', 4) + rows_of('default', 4)  # alike: the worst case for hiding
    with rc_context(STYLE):
        axes = draw_main(rows).axes[0]
    assert [tick.get_text() for tick in axes.get_yticklabels()] == ['bare', 'default']
    points = [
        (float(bars.lines[0].get_xdata()[0]), float(bars.lines[0].get_ydata()[0]))
        for bars in axes.containers
    ]
    heights = sorted(y for _, y in points)
    assert len(points) == 8 and min(later - y for y, later in zip(heights, heights[1:])) > 0.1
    x, _, (segments,) = errorbars(axes)['person needed']
    assert x[0] == pytest.approx(40.0)
    assert segments[0][:, 0] == pytest.approx([100 * end for end in wilson_interval(4, 10)])


def test_the_bound_stands_beside_each_variant_on_the_same_seeds_alone():
    """Seeds 7 to 16 were run by all, and 17 to 26 by two of three."""
    later = [
        row._replace(seed=row.seed + 10, replicate=1, ending='failure', true_success=False)
        for variant in ('bare', 'default')
        for row in rows_of(variant, 0)
    ]
    rows = rows_of('bare', 2) + rows_of('default', 1) + later + rows_of('ladder', 3)
    assert {name: len(mine) for name, mine in with_hindsight(rows).items()} == dict.fromkeys(
        ('bare', 'default', 'ladder', 'hindsight'), 10
    )
    with rc_context(STYLE):
        assert [tick.get_text() for tick in draw_main(rows).axes[0].get_yticklabels()] == [
            'bare',
            'default',
            'ladder',
        ]
        (axes,) = draw_same_seeds(rows).axes
    assert axes.get_title('left') == 'Pick and place, 10 seeds that all ran'
    assert [tick.get_text() for tick in axes.get_yticklabels()][-1] == 'hindsight'
    shares = [float(bars.lines[0].get_xdata()[0]) for bars in axes.containers]
    assert shares[1::4] == [20.0, 10.0, 30.0, 10.0], 'person needed'
    tables = cells_of(format_tables(rows))
    assert tables[1]['person needed'] == [
        '60.0% (39% to 78%)',
        '55.0% (34% to 74%)',
        '30.0% (11% to 60%)',
    ]
    assert tables[0]['variant'][:3] == ['trials', 'true success', 'person needed']
    assert [tables[0][name][:3] for name in ('bare', 'ladder')] == [
        ['20', '50.0% (30% to 70%)', '60.0% (39% to 78%)'],
        ['10', '100.0% (72% to 100%)', '30.0% (11% to 60%)'],
    ]
    bounded = next(table for table in tables if 'hindsight' in table.get('', ()))
    assert [cell.split()[0] for cell in bounded['person needed']] == [
        '20.0%',
        '10.0%',
        '30.0%',
        '10.0%',
    ]
    assert 'the 10 seeds that all variants ran' in format_tables(rows)
    assert 'on the 10 seeds that all variants ran' in format_comparison(rows)


def test_persistence_is_drawn_over_the_share_with_variants_beside_each_other():
    rows = [
        row
        for share in (0.0, 0.5, 1.0)
        for variant in ('bare', 'default')
        for row in rows_of(variant, 3, lasting_share=share)
    ]
    with rc_context(STYLE):
        needed, success = draw_persistence(rows).axes
    drawn = errorbars(needed)
    assert [list(drawn[name][1]) for name in ('bare', 'default')] == [[30.0] * 3] * 2
    assert all(abs(one - other) > 2 for one, other in zip(drawn['bare'][0], drawn['default'][0]))
    assert [tick.get_text() for tick in success.get_xticklabels()] == ['0', '50', '100']
    assert list(errorbars(success)['bare'][1]) == [100.0] * 3


def test_the_memory_figure_tells_how_often_the_expert_is_asked():
    rows = rows_of('default_memory_2', 5) + rows_of('default_memory_20', 1)
    with rc_context(STYLE):
        asked = draw_memory(rows).axes[0]
    x, y, _ = errorbars(asked)['default']
    assert list(x) == [2.0, 20.0] and list(y) == [50.0, 10.0]
    assert asked.get_ylim() == (0.0, 80.0), 'the interval of 5 of 10 ends at 76%'


def test_the_hours_have_events_counts_and_learned_rates():
    rows = [
        row._replace(hour=0.5 * number, learned=LEARNED, causes='glare' if number == 3 else '')
        for number, row in enumerate(rows_of('default', 2))
    ]
    rows[5] = rows[5]._replace(causes='glare', cause_log='[["glare",true,null,null]]')
    with rc_context(STYLE):
        events, needed, rates = draw_hours(rows).axes
    assert len(events.patches) == 1, 'the light of one trial: that of another never came'
    curve = next(line for line in needed.lines if line.get_label() == 'person needed')
    assert curve.get_ydata()[-1] == 2 and curve.get_xdata()[-1] == 4.5
    assert [line.get_label() for line in rates.lines] == ['PICK', 'PLACE']


def test_rates_are_those_that_the_oracle_goes_by_from_the_end_of_a_trial_on():
    """The window of 10 is filled with the prior of 0.2: (2 + 6 * 0.2) / 10."""
    rows = [
        row._replace(hour=1.0, learned=LEARNED, memory=10, prior=0.2)
        for row in rows_of('default', 0, 1)
    ]
    end = 1.0 + 60 / 3600
    assert learned_rates(rows) == {'PICK': [(end, pytest.approx(0.32))], 'PLACE': [(end, 0.15)]}
    older = [row._replace(memory=None, prior=None) for row in rows]
    assert learned_rates(older)['PICK'] == [(end, pytest.approx(0.26))]


def test_a_lost_trial_is_among_the_hours():
    rows = [
        row._replace(hour=0.5 * number, learned=LEARNED)
        for number, row in enumerate(rows_of('default', 0))
    ]
    rows[4] = rows[4]._replace(ending='lost', true_success=None, sim_s=None, learned='')
    with rc_context(STYLE):
        events, needed, _ = draw_hours(rows).axes
    assert list(next(line for line in events.lines if line.get_label() == 'lost').get_xdata()) == [
        2.0
    ]
    curve = next(line for line in needed.lines if line.get_label() == 'person needed')
    assert list(curve.get_xdata()[curve.get_ydata() == 1])[0] == 2.0


def test_the_main_table_has_a_line_for_each_figure_and_a_column_for_each_variant():
    told = cells_of(
        format_tables(rows_of('bare', 0) + rows_of('default', 2, attempts=1, expert_s=6.0))
    )[1]
    assert told[''] == ['bare', 'default'] and told['trials'] == ['10', '10']
    assert told['person needed'][1] == '20.0% (6% to 51%)'
    assert [
        told[name][1]
        for name in (
            'attempts a trial',
            'expert s a trial',
            'expert s a robot hour',
            'trials per person needed',
            's to completion, median',
        )
    ] == ['1', '6', '360', '5', '60']


def test_the_tables_test_the_default_against_each_other_variant():
    rows = [
        row
        for name, asked in (('bare', 8), ('default', 1), ('restart', 3), ('ladder', 7))
        for row in rows_of(name, asked)
    ]
    tests = cells_of(format_tables(rows))[2]
    assert tests['default against ladder'] == ['10', '1', '0', '6', '3', '0.031']
    assert [name for name in tests if name] == [
        'default against ' + each for each in ('bare', 'restart', 'ladder')
    ]


def test_over_replicates_stand_the_smallest_and_the_largest_share():
    rows = [
        row._replace(replicate=number)
        for number, asked in enumerate((1, 4, 2))
        for row in rows_of('default', asked)
    ]
    share = next(each for each in shares_of(rows) if each.name == 'person needed')
    assert share.over_replicates == (0.1, 0.4)
    assert shares_of(rows[:10])[0].over_replicates is None
    told = cells_of(format_tables(rows + rows_of('ladder', 0)))[1]
    assert told['person needed, replicates'] == ['10.0% to 40.0% (0% to 61%)', '-']
    assert 'replicates 10.0% to 40.0%' in format_comparison(rows)
    assert 'person needed, replicates' not in format_tables(rows[:10])


def test_the_main_figure_has_a_bar_from_the_smallest_to_the_largest_replicate():
    rows = [
        row._replace(replicate=number)
        for number, asked in enumerate((1, 4, 2))
        for row in rows_of('default', asked)
    ]
    with rc_context(STYLE):
        bars = draw_main(rows + rows_of('ladder', 0)).axes[0].collections
    ends = [
        tuple(segment[:, 0])
        for each in bars
        if each.get_label() == 'replicates'
        for segment in each.get_segments()
    ]
    assert len(ends) == 4 and ends[1] == pytest.approx((10.0, 40.0))


def test_completion_is_compared_on_the_seeds_that_all_three_completed():
    """The bare script completes the short trials alone, so its median is the shortest."""
    rows = [
        row._replace(
            sim_s=10.0 * row.seed,
            **(
                {'ending': 'failure', 'true_success': False}
                if name == 'bare' and row.seed > 9
                else {}
            ),
        )
        for name in ('bare', 'default', 'restart', 'ladder')
        for row in rows_of(name, 0)
    ]
    told = cells_of(format_tables(rows))[1]
    assert told['s to completion, median'] == ['80', '115', '115', '115']
    assert told[
        's to completion, median, on the 3 seeds that bare, default and restart completed'
    ] == ['80', '80', '80', '-']
    assert 'on the 3 seeds' not in format_tables(rows_of('bare', 0) + rows_of('default', 0))


def test_the_tables_say_which_hours_count():
    rows = rows_of('default', 0)
    assert 'The time between trials does not count' in format_tables(rows)
    on = [row._replace(hour=0.5 * number) for number, row in enumerate(rows)]
    assert 'The time between trials counts, too' in format_tables(on)


def test_the_difference_to_restart_is_told_at_each_share_of_lasting_causes():
    rows = [
        row
        for share, first, second in ((0.0, 3, 3), (1.0, 2, 9))
        for name, asked in (('default', first), ('restart', second))
        for row in rows_of(name, asked, lasting_share=share)
    ]
    (differences,) = (
        cells
        for cells in cells_of(format_sweeps('persistence', rows))
        if 'causes that last' in cells
    )
    assert differences['0%'] == ['10', '30.0%', '30.0%', '0.0% (-20.0% to 20.0%)']
    assert differences['100%'][:3] == ['10', '20.0%', '90.0%']
    assert differences['100%'][3].startswith('-70.0% (-86.5% to -26.6%)')
    assert format_sweeps('persistence', rows_of('default', 0, lasting_share=0.0)) == ''


def test_the_trend_over_the_memory_is_tested_within_seeds():
    rows = [
        row
        for memory, asked in ((2, 1), (10, 4), (50, 8))
        for row in rows_of('default_memory_{}'.format(memory), asked)
    ]
    text = format_sweeps('memory', rows)
    (told,) = cells_of(text)
    assert [told[number][1].split(' (')[0] for number in ('2', '10', '50')] == [
        '1 of 10, 10.0%',
        '4 of 10, 40.0%',
        '8 of 10, 80.0%',
    ]
    assert 'z = 3.24 (above 0: the share grows), p = 0.0012' in text
    assert 'z = -' in format_sweeps(
        'memory', [row._replace(variant=row.variant.replace('50', '1')) for row in rows]
    )


def test_tasks_stand_in_the_order_of_the_paper_and_sweeps_of_the_memory_have_no_tests():
    rows = [
        row
        for task in ('drink_retrieval', 'pick_and_place')
        for name in ('default_memory_2', 'default_memory_5')
        for row in rows_of(name, 1, task=task)
    ]
    text = format_tables(rows)
    assert text.index('**Pick and place**') < text.index('**Drink retrieval**')
    assert 'paired by seed' in text and 'hindsight' in text
    memory = format_tables(rows, 'memory')
    assert 'paired by seed' not in memory and 'hindsight' not in memory


def test_shares_of_lasting_causes_are_never_compared_with_each_other():
    rows = rows_of('bare', 5, lasting_share=0.0) + rows_of('default', 0, lasting_share=1.0)
    text = format_comparison(rows)
    assert '0% of the causes last' in text and '100% of the causes last' in text
    assert 'McNemar' not in text and 'hindsight' not in text


def test_rows_with_extra_causes_are_never_compared_with_the_others():
    usual = rows_of('restart', 4) + rows_of('default', 1)
    extra = rows_of('default', 3, count=5, extra_causes=True)
    assert format_tables(usual) in format_tables(usual + extra)
    told = format_comparison(usual + extra)
    assert told.startswith(format_comparison(usual)) and told.count('extra causes') == 1
    assert '(5 trials' in told and '(15 trials' not in told


def test_a_world_that_goes_on_is_another_experiment():
    usual = rows_of('restart', 4) + rows_of('default', 1)
    going_on = rows_of('default', 3, count=5, hour=0.5)
    told = format_comparison(going_on + usual)
    assert told.startswith(format_comparison(usual)) and 'continuous operation\n' in told
    assert '(5 trials' in told and '(15 trials' not in told


def test_a_world_that_goes_on_has_hours_between_its_trials():
    rows = [row._replace(hour=0.5 * number) for number, row in enumerate(rows_of('default', 1, 3))]
    assert robot_hours(rows) == pytest.approx(1.0 + 60 / 3600)
    assert costs_of(rows).hours_between == pytest.approx(1.0 + 60 / 3600)
    assert robot_hours(rows_of('default', 1, 3)) == pytest.approx(180 / 3600)


def test_the_command_draws_what_there_is_and_the_same_rows_give_the_same_files(tmp_path):
    for name, rows in (
        ('pick_and_place_compared', rows_of('bare', 1)),
        ('pick_and_place_memory', rows_of('default_memory_5', 1)),
        ('pick_and_place_persistence_50', rows_of('bare', 1, lasting_share=0.5)),
        ('pick_and_place_continuous', rows_of('default', 1, hour=0.0)),
        ('pick_and_place_fifth_extra', rows_of('bare', 1, extra_causes=True)),
    ):
        (tmp_path / name).mkdir()
        append_rows(tmp_path / name / 'results.csv', rows)
    for out in ('one', 'two'):
        assert command.main([str(tmp_path), str(tmp_path / out)]) == 0
    names = sorted(path.name for path in (tmp_path / 'one').iterdir())
    assert names == sorted(
        ['tables.md'] + [kind + end for kind in command.KINDS for end in ('.svg', '.png')]
    )
    for name in names:
        assert (tmp_path / 'one' / name).read_bytes() == (tmp_path / 'two' / name).read_bytes()


def test_a_folder_without_rows_is_refused(tmp_path, capsys):
    assert command.main([str(tmp_path), str(tmp_path / 'out')]) == 2
    assert 'no results.csv' in capsys.readouterr().err
    assert not (tmp_path / 'out').exists()
