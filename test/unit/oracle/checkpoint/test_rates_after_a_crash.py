"""What a killed machine has learned goes to its rates file once."""

import json

import pytest
from killed_machines import KilledMachine, Noted
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
