"""What a killed machine has learned goes to its rates file once, and under one name."""

import json

import pytest
from killed_machines import KilledMachine, Noted, each_of
from killed_trees import ENDS
from left_stores import Left

import smach


def fetch(diary, points):
    """HOME, then a machine in which PICK fails once, then PLACE."""
    inner = smach.StateMachine(['succeeded', 'aborted'], ['done'], ['done'])
    with inner:
        inner.add('LOOK', Noted('LOOK', diary, points), {'succeeded': 'PICK'})
        inner.add('PICK', Noted('PICK', diary, points, failures=1), ENDS)
    machine = smach.StateMachine(['succeeded', 'aborted'])
    machine.userdata.done = []
    with machine:
        machine.add('HOME', Noted('HOME', diary, points), {'succeeded': 'GET'})
        machine.add('GET', inner, {'succeeded': 'PLACE'})
        machine.add('PLACE', Noted('PLACE', diary, points), ENDS)
    return machine


def learned(path):
    """Successes and failures by state."""
    containers = json.loads(path.read_text())['machines']['TOP']
    return {
        label: (told['successes'], told['failures'])
        for states in containers.values()
        for label, told in states.items()
    }


@pytest.mark.parametrize('state, times', [('PICK', 2), ('PLACE', 1)])
def test_no_result_counts_twice_long_after_the_file_had_it(tmp_path, state, times):
    path, point = tmp_path / 'rates.json', Left(fetch).first_in(state, times)
    killed = KilledMachine(tmp_path, fetch, rates_file=str(path))
    assert killed.run(kill_at=point) is None
    assert learned(path)['HOME'] == (1, 0) and learned(path)['PICK'] == (0, 1)
    assert killed.run()['outcome'] == 'succeeded'
    found, ended = learned(path), killed.diary.count('ends')
    assert {label: sum(found[label]) for label in ended} == ended


def test_a_failure_says_its_item_once_where_it_is_recovered_from_after_a_crash(tmp_path):
    def items(diary, points):
        machine = smach.StateMachine(['succeeded', 'aborted'])
        machine.userdata.done = []
        with machine:
            state = Noted('PICK', diary, points, failures=1, keys=('done', 'item'))
            machine.add('ALL', each_of(range(2), 'PICK', state), ENDS)
        return machine

    left, said = Left(items), []
    for point in left.points():
        told = left.killed_at(point, tmp_path / 'killed').run()
        said += [line for line in told['log'] if 'PICK failed' in line]
    assert any('item 1 of 2' in line for line in said)
    assert [line for line in said if line.count('item 1 of 2') > 1] == []
