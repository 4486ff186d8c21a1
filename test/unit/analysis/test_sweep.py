"""Questions by the oracle's memory and policy."""

import pytest
from fake_trials import FakeMachine
from test_table import trial

from smach_oracle.analysis import sweep
from smach_oracle.analysis.reading import ALL_READ, NOTHING_COUNTED
from smach_oracle.analysis.variants import find_variants
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.ros.recorder import TrialRecorder


def under(policy, memory, asked, runs=10, **fields):
    """Trials under one oracle, some of which asked."""
    return [
        trial(
            number,
            questions=int(number < asked),
            answered=int(number < asked),
            settings=(('memory', memory), ('policy', policy)),
            **fields,
        )
        for number in range(runs)
    ]


def points():
    return sweep.find_points(
        find_variants(
            under('prose', 10, 2)
            + under('prose', 2, 5)
            + under('algorithm1', 10, 1)
            + under('algorithm1', 2, 4)
            + [trial(0, recovers=False)]
        )
    )


def test_each_oracle_is_a_point_in_the_order_of_its_memory():
    assert [
        (point.label, point.memory, point.asked.trials, point.trials) for point in points()
    ] == [
        ('algorithm1', 2, 4, 10),
        ('algorithm1', 10, 1, 10),
        ('prose', 2, 5, 10),
        ('prose', 10, 2, 10),
    ]


def test_the_table_shows_shares_with_intervals():
    text = sweep.format_points(points(), wide=True)
    assert text.splitlines()[1].split()[:3] == ['memory', 'N', 'trials']
    assert 'PICK_AND_PLACE, algorithm1\n' in text and 'PICK_AND_PLACE, prose\n' in text
    row = next(
        line for line in text.split('prose')[1].splitlines() if line.startswith('         2')
    )
    assert row.split()[:6] == ['2', '10', '50.0%', '(23.7', 'to', '76.3%)']
    assert row.split()[-7:-3] == ['unknown', 'at', 'least', '50.0%']


def test_the_narrow_tables_say_the_same_in_at_most_100_columns():
    trials = [
        trial(number, questions=1, settings=(('memory', 100000), ('policy', 'prose')), bags=(bag,))
        for number, bag in enumerate(['a/1.bag', 'a/2.bag', 'b/3.bag'])
    ]
    found = sweep.find_points(find_variants(trials))
    narrow, wide = (sweep.format_points(found, each) for each in (False, True))
    assert max(map(len, narrow.splitlines())) <= 100 < max(map(len, wide.splitlines()))
    first, rest = '  memory N  trials   ', '100.0% (43.9 to 100.0%)'
    assert sum(line.startswith(first) for line in narrow.splitlines()) == 2
    assert narrow.count(rest) == wide.count(rest) == 2
    assert set(narrow.split()) == set(wide.split())


def test_other_settings_that_differ_are_in_the_label():
    trials = under('prose', 10, 2) + [
        trial(99, settings=(('high_from', 0.8), ('memory', 10), ('policy', 'prose')))
    ]
    assert {point.label for point in sweep.find_points(find_variants(trials))} == {
        'prose',
        'prose, high_from 0.8',
    }


def test_the_figure_is_the_same_for_the_same_trials(tmp_path):
    files = [
        [open(path, 'rb').read() for path in sweep.save_figure(points(), str(tmp_path / name))]
        for name in 'ab'
    ]
    assert files[0] == files[1] and len(files[0][1]) > 5000


def test_the_figure_has_every_memory_once_on_its_axis():
    from smach_oracle.analysis import sweep_figure

    drawn = sweep_figure.draw(sweep.by_label(points()))
    (axes,) = drawn.axes
    assert [label.get_text() for label in axes.get_xticklabels()] == ['2', '10']
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ['algorithm1', 'prose']


@pytest.mark.parametrize('recovers', [True, False])
def test_the_command(tmp_path, capsys, recovers):
    recorder = TrialRecorder(str(tmp_path / 'bags'), warn=pytest.fail)

    def tell(event):
        if event.kind == EventKind.TRIAL_START:
            event = event._replace(
                data=dict(event.data, settings={'policy': 'prose', 'memory': 10})
            )
        recorder(event)

    machine = FakeMachine(tell, recovers)
    for seed in range(20):
        machine.run(seed)
    assert recorder.close(20.0)
    code = sweep.main([str(tmp_path / 'bags'), '--figure', str(tmp_path / 'sweep')])
    out, err = capsys.readouterr()
    if recovers:
        assert (
            code == ALL_READ
            and 'PICK_AND_PLACE, prose' in out
            and (tmp_path / 'sweep.svg').exists()
        )
    else:
        assert code == NOTHING_COUNTED and 'no trials with an oracle' in err
