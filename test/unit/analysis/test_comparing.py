"""Groups of trials compared, against figures worked out elsewhere."""

import json
import math
from pathlib import Path

import pytest
from test_table import told, trial

from smach_oracle.analysis import bag_statistics
from smach_oracle.analysis.comparing.group_tests import (
    difference_interval,
    fisher_exact,
    pairing_of,
    share_tests,
)
from smach_oracle.analysis.comparing.groups import (
    BY,
    NOT_RECORDED,
    TrialGroup,
    groups_by,
    other_differences,
)
from smach_oracle.analysis.comparing.report import MOST_GROUPS, compared, format_groups, groups_data
from smach_oracle.analysis.trial_counter import TrialEnding

OLD_BAGS = str(Path(__file__).parents[2] / 'data/v0_1')
FAILED = TrialEnding.FAILURE


# scipy 1.10: stats.fisher_exact([[first, first_of - first], [second, second_of - second]])
@pytest.mark.parametrize(
    'counts, p_value',
    [
        ((3, 4, 1, 4), 0.485714),
        ((8, 10, 1, 6), 0.034965),
        ((0, 8, 8, 8), 0.000155),
        ((43, 150, 3, 40), 0.006067),
        ((0, 5, 0, 9), 1.0),
    ],
)
def test_fishers_exact_test(counts, p_value):
    assert fisher_exact(*counts) == pytest.approx(p_value, abs=1e-5)
    first, first_of, second, second_of = counts
    assert fisher_exact(second, second_of, first, first_of) == fisher_exact(*counts)
    other = (first_of - first, first_of, second_of - second, second_of)
    assert fisher_exact(*other) == pytest.approx(fisher_exact(*counts))


@pytest.mark.parametrize('counts', [(-1, 4, 0, 4), (5, 4, 0, 4), (0, 4, 9, 4)])
def test_impossible_counts_are_refused(counts):
    with pytest.raises(ValueError, match='allowed: each 0 to'):
        fisher_exact(*counts)


# Newcombe (1998), table II, method 10: 56/70 less 48/80, and 9/10 less 3/10
@pytest.mark.parametrize(
    'counts, low, high',
    [((56, 70, 48, 80), 0.0524, 0.3339), ((9, 10, 3, 10), 0.1705, 0.8090)],
)
def test_newcombes_interval_of_a_difference(counts, low, high):
    assert difference_interval(*counts) == pytest.approx((low, high), abs=1e-4)
    assert difference_interval(0, 0, 1, 2) == (-1.0, 1.0)


def groups(*named):
    return [TrialGroup('TOP', name, tuple(trials)) for name, trials in named]


def test_trials_with_the_same_seeds_are_paired():
    one = [told(number, number > 2, True) for number in range(10)]
    other = [told(number, True, True) for number in range(2, 14)]
    first, second = groups(('a', one), ('b', other))
    pairing = pairing_of(first, second)
    assert (pairing.by, len(pairing.pairs)) == ('seed', 8)
    failed = next(test for test in share_tests(first, second) if test.name == 'ended in failure')
    assert failed.is_paired and (failed.first, failed.first_of, failed.second) == (1, 8, 0)
    assert failed.p_value == 1.0
    text = format_groups('folder', [first, second])
    assert "8 pairs by seed, 6 trials left out: McNemar's exact test" in text


@pytest.mark.parametrize('twice', [True, False])
def test_trials_without_seeds_or_with_a_seed_twice_are_not_paired(twice):
    one = [told(3, False, True), told(3, False, True)] if twice else [trial(0), trial(1)]
    first, second = groups(('a', one), ('b', [told(3, True, True)]))
    assert pairing_of(first, second) == ('', [])
    assert not any(test.is_paired for test in share_tests(first, second))


def with_inputs(number, **inputs):
    return trial(number, inputs=tuple(sorted(inputs.items())))


def test_trials_that_began_with_the_same_inputs_are_paired():
    rooms = ['kitchen', 'hall', 'office', 'attic']
    one = [with_inputs(number, room=room) for number, room in enumerate(rooms)]
    other = [with_inputs(number, room=room) for number, room in enumerate(rooms[1:] + ['cellar'])]
    first, second = groups(('a', one), ('b', other))
    by, pairs = pairing_of(first, second)
    assert by == 'inputs'
    assert [(ours.inputs, theirs.inputs) for ours, theirs in pairs] == [
        ((('room', room),),) * 2 for room in rooms[1:]
    ]
    text = format_groups('folder', [first, second])
    assert "3 pairs by inputs, 2 trials left out: McNemar's exact test" in text


@pytest.mark.parametrize(
    'inputs', [({'n': 1}, {'n': 1}), ({'n': 1}, {}), ({'n': 1}, {'n': 2})], ids=repr
)
def test_inputs_pair_nothing_where_a_trial_has_none_or_the_same_or_none_is_in_both(inputs):
    first, second = groups(
        ('a', [with_inputs(number, **each) for number, each in enumerate(inputs)]),
        ('b', [with_inputs(7, n=7)]),
    )
    assert pairing_of(first, second) == ('', [])


def test_seeds_pair_before_inputs():
    one, other = (
        [told(number, True, True)._replace(inputs=(('n', number % 2),)) for number in range(4)]
        for _ in range(2)
    )
    assert pairing_of(*groups(('a', one), ('b', other))).by == 'seed'


def test_true_success_is_tested_where_a_judge_saw_trials_of_both():
    first, second = groups(('a', [told(0, True, True)]), ('b', [told(1, True, False)]))
    assert 'true success' in [test.name for test in share_tests(first, second)]
    first, second = groups(('a', [told(0, True, True)]), ('b', [trial(1)]))
    tests = {test.name: test for test in share_tests(first, second)}
    assert 'true success' not in tests
    assert tests['person needed'].is_bound and tests['person needed'].second_of == 1
    assert 'person needed (least)' in format_groups('day', [first, second])


def test_two_robots_are_two_groups():
    trials = [trial(0, node='/robot1/fetch'), trial(1, node='/robot2/fetch'), trial(2)]
    found = groups_by('node', trials, [])
    assert [(group.name, len(group.trials)) for group in found] == [
        ('/robot1/fetch', 1),
        ('/robot2/fetch', 1),
        (NOT_RECORDED, 1),
    ]


def test_folders_are_those_that_were_given_or_those_of_the_bags():
    trials = [
        trial(number, bags=(bag,)) for number, bag in enumerate(('/x/a/1.bag', '/x/a/r/2.bag'))
    ] + [trial(2, bags=('/x/ab/3.bag',))]
    assert [group.name for group in groups_by('folder', trials, ['/x/a', '/x/ab'])] == ['a', 'ab']
    assert [group.name for group in groups_by('folder', trials, ['/x/a', '/x/a/r', '/x/ab'])] == [
        'a',
        'a/r',
        'ab',
    ]
    assert [group.name for group in groups_by('folder', trials[:2], ['/x'])] == ['a', 'a/r']


def test_days_are_in_utc_and_a_clock_that_was_off_is_no_error():
    trials = [
        trial(0, start_time=86399.0),
        trial(1, start_time=86401.0),
        trial(2, start_time=1e300),
    ]
    names = [group.name for group in groups_by('day', trials, [])]
    assert names == ['1970-01-01', '1970-01-02', NOT_RECORDED]
    nan = groups_by('day', [trial(0, start_time=math.nan)], [])
    assert [group.name for group in nan] == [NOT_RECORDED]


def test_settings_are_named_by_those_that_differ():
    trials = [
        trial(0, settings=(('memory', 5), ('policy', 'prose'))),
        trial(1, settings=(('memory', 10), ('policy', 'prose'))),
        trial(2, recovers=False),
    ]
    assert [group.name for group in groups_by('settings', trials, [])] == [
        'with oracle, memory 10',
        'with oracle, memory 5',
        'without oracle',
    ]
    digests = [
        trial(n, settings=(('memory', 5),), origin=(('settings', d),)) for n, d in enumerate('ab')
    ]
    names = [group.name for group in groups_by('settings', digests, [])]
    assert names == ['with oracle', 'with oracle, settings b']


def test_host_version_and_script_come_from_the_start_of_the_trial():
    origin = (('host', 'arm'), ('version', '0.2.0'), ('script', 'fetch.py 0a1b'))
    trials = [trial(0, origin=origin), trial(1)]
    for by, name in origin:
        assert [group.name for group in groups_by(by, trials, [])] == [name, NOT_RECORDED]


def test_a_warning_names_what_differs_beyond_what_is_compared():
    first, second = groups(
        ('a', [trial(0, node='/a', settings=(('memory', 5),))]),
        ('b', [trial(1, node='/b', settings=(('memory', 9),), start_time=1e6)]),
    )
    found = other_differences('node', first, second)
    assert [clause.split(' (')[0] for clause in found] == ['settings', 'day']
    assert 'Warning: these groups differ in more: settings' in format_groups(
        'node', [first, second]
    )
    assert 'Warning' not in format_groups('node', [first, first])
    assert groups_data('node', [first, second])['warnings'][0]['differ_in'] == found


def test_many_groups_are_each_compared_with_the_first():
    many = groups(*((str(number), [trial(number)]) for number in range(MOST_GROUPS + 2)))
    assert {pair.first.name for pair in compared('day', many)} == {'0'}
    assert len(compared('day', many)) == MOST_GROUPS + 1
    assert 'not corrected' in format_groups('day', many)
    assert 'nothing to test' in format_groups('day', many[:1])


@pytest.mark.parametrize('by', BY)
def test_old_bags_are_compared_by_each(by, tmp_path, capsys):
    out = tmp_path / 'a.json'
    assert bag_statistics.main([OLD_BAGS, '--by', by, '--json', str(out)]) == 0
    text = capsys.readouterr().out
    assert 'Compared by {}\n'.format(by) in text and 'nan' not in text
    data = json.loads(out.read_text())
    assert data['compared']['by'] == by
    assert sum(group['trials'] for group in data['compared']['groups']) == len(data['trials'])


def test_another_word_is_refused(capsys):
    with pytest.raises(SystemExit):
        bag_statistics.main([OLD_BAGS, '--by', 'robot'])
    assert 'invalid choice' in capsys.readouterr().err
