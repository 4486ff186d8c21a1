"""What TRIAL_START says of where and with what a trial began."""

import json
import math
import os
import platform
import subprocess
import sys

import pytest
from machines import Scripted, watched

import smach
from smach_oracle import __version__
from smach_oracle.oracle import OracleContainer, Settings
from smach_oracle.oracle.execution import origin
from smach_oracle.oracle.execution.origin import (
    LONGEST_INPUT,
    MOST_INPUTS,
    inputs_of,
    origin_of,
)
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.oracle.settings.health import HealthCondition, HealthKind

SCRIPT = """
import json, smach
from smach_oracle.oracle import OracleContainer
machine = smach.StateMachine(['succeeded'])
with machine:
    smach.StateMachine.add('A', smach.CBState(lambda userdata: 'succeeded', outcomes=['succeeded']))
machine.userdata.room = 'hall'
starts = []
OracleContainer.wrap(machine).events.observers.append(starts.append)
machine.execute()
print(json.dumps(starts[0].data))
"""


def told_by(script):
    """The data of TRIAL_START of a script that prints it."""
    done = subprocess.run([sys.executable, str(script)], check=True, stdout=subprocess.PIPE)
    return json.loads(done.stdout.splitlines()[-1])


def digest(settings):
    return origin_of(Settings.from_dict(settings))['settings']


def test_a_trial_tells_its_script_and_versions_and_another_script_differs(tmp_path):
    one, other = tmp_path / 'fetch.py', tmp_path / 'other.py'
    one.write_text(SCRIPT)
    other.write_text(SCRIPT + '# changed')
    first, again, changed = told_by(one), told_by(one), told_by(other)
    assert first['inputs'] == {'room': 'hall'}
    told = first['origin']
    assert (told['version'], told['python']) == (__version__, platform.python_version())
    assert told == again['origin']
    name, mark = told['script'].split()
    assert name == 'fetch.py'
    assert mark not in changed['origin']['script'] and changed['origin']['script'][:8] == 'other.py'


def test_without_a_script_none_is_named():
    done = subprocess.run([sys.executable, '-c', SCRIPT], check=True, stdout=subprocess.PIPE)
    assert 'script' not in json.loads(done.stdout.splitlines()[-1])['origin']


@pytest.mark.parametrize('name', [None, 7, 'nowhere.py', '.', '/dev/null', 'a\0b', 'pipe'])
def test_a_name_that_is_no_plain_file_is_no_script(monkeypatch, tmp_path, name):
    os.mkfifo(str(tmp_path / 'pipe'))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys.modules['__main__'], '__file__', name, raising=False)
    assert origin._script() == ''


def test_a_script_whose_name_is_no_text_is_named_as_far_as_it_is(monkeypatch, tmp_path):
    path = os.fsdecode(os.fsencode(str(tmp_path)) + b'/\xff.py')
    with open(path, 'w', encoding='ascii') as script:
        script.write('pass')
    monkeypatch.setattr(sys.modules['__main__'], '__file__', path, raising=False)
    assert origin._script().startswith('?.py ')


def test_settings_have_the_same_digest_if_they_are_the_same():
    given = {'memory': 20, 'states': {'PICK': {'on_retry': 'never'}}}
    assert digest(given) == digest(json.loads(json.dumps(given)))


def test_the_order_in_which_states_are_set_does_not_count():
    given = {'PICK': {'on_retry': 'never'}, 'LOOK': {'autonomy': 'announce'}}
    turned = dict(reversed(list(given.items())))
    assert digest({'states': given}) == digest({'states': turned})


@pytest.mark.parametrize(
    'other',
    [
        {'memory': 21},
        {'policy': 'escalating'},
        {'states': {'PICK': {'on_retry': 'confirm'}}},
        {'states': {'PICK': {'preconditions': ['LOOK']}}},
        {'budget': {'minutes': 3}},
    ],
    ids=repr,
)
def test_other_settings_have_another_digest(other):
    assert digest(other) != digest({'memory': 20, 'states': {'PICK': {'on_retry': 'never'}}})
    assert digest(other) != digest({})


def test_conditions_of_one_name_have_not_the_same_digest():
    conditions = (
        HealthCondition(HealthKind.TOPIC, 'power'),
        HealthCondition(HealthKind.DIAGNOSTICS, 'power'),
        HealthCondition(HealthKind.FUNCTION, 'power', function=os.getpid),
        HealthCondition(HealthKind.FUNCTION, 'power', function=os.getppid),
    )
    digests = {origin_of(Settings(healthy=(each,)))['settings'] for each in conditions}
    assert len(digests) == len(conditions)


def test_a_function_among_the_settings_counts_by_its_name():
    def is_open(userdata):
        return True

    def is_lit(userdata):
        return True

    def with_check(function):
        return digest({'states': {'PICK': {'preconditions': [function]}}})

    assert with_check(is_open) == with_check(is_open) != with_check(is_lit)


class Touchy(str):
    def __len__(self):
        raise AssertionError('it is not asked')


def test_inputs_are_the_plain_values_of_the_userdata():
    userdata = smach.UserData()
    userdata.room, userdata.count, userdata.is_wet, userdata.height = 'hall', 3, True, 0.5
    userdata.long, userdata.none, userdata.places = 'x' * (LONGEST_INPUT + 1), None, [1]
    userdata.far, userdata.touchy, userdata.large = math.inf, Touchy('a'), 10**5000
    userdata[7] = 'a key that is no word'
    assert inputs_of(userdata) == {'room': 'hall', 'count': 3, 'is_wet': True, 'height': 0.5}


def test_inputs_may_be_as_long_and_almost_as_large_as_the_limits():
    userdata = smach.UserData()
    userdata.long, userdata.large = 'x' * LONGEST_INPUT, 2**63 - 1
    userdata.too_large = 2**63
    assert inputs_of(userdata) == {'long': 'x' * LONGEST_INPUT, 'large': 2**63 - 1}


def test_inputs_are_few_and_those_of_no_userdata_are_none():
    userdata = smach.UserData()
    for number in range(MOST_INPUTS + 5):
        userdata['key_{:02}'.format(number)] = number
    assert list(inputs_of(userdata).values()) == list(range(MOST_INPUTS))
    assert inputs_of({'room': 'hall'}) == {} == inputs_of(None)


def test_inputs_are_those_at_the_start_of_each_trial():
    def counts(userdata):
        userdata.count += 1
        return 'succeeded'

    machine = smach.StateMachine(['succeeded'])
    with machine:
        state = smach.CBState(
            counts, outcomes=['succeeded'], input_keys=['count'], output_keys=['count']
        )
        smach.StateMachine.add('A', state)
    machine.userdata.count = 0
    seen = []
    OracleContainer.wrap(machine).events.observers.append(seen.append)
    for _ in range(3):
        machine.execute()
    starts = [event for event in seen if event.kind == EventKind.TRIAL_START]
    assert [event.data['inputs'] for event in starts] == [{'count': each} for each in range(3)]


def test_the_engine_of_this_package_is_known():
    machine = watched(Scripted())
    machine.run()
    (start,) = machine.of(EventKind.TRIAL_START)
    is_own = not os.environ.get('SMACH_UPSTREAM')
    assert (start.data['origin']['engine'] == 'own') is is_own
