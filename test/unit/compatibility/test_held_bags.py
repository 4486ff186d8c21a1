"""Bags of version 0.1: every message unpacks, and the analysis gives the figures that it gave."""

import held_trials
import pytest
import readings
from held import (
    DATA,
    EXPECTED,
    bags,
    expected,
    lacking,
    name_of,
    numbers,
    run,
    without_person_needed,
)

NAMES = [name_of(path) for path in bags()]
EVENTS = {
    name: [held_trials.lengthened(event) for event in events]
    for name, events in expected('events').items()
}
TOPICS = expected('topics')
MACHINES = expected('machines')
READERS = {'rosbag': held_trials.with_rosbag, 'rosbags': held_trials.with_rosbags}
# of OracleEvent.msg, by name
CONSTANTS = {
    name: int(value)
    for name, (_, value) in expected('interface_files')['msg/OracleEvent.msg'][0][
        'constants'
    ].items()
}
# by name: exit codes that are others now, for version 0.1 did not name a trial that lacks events
CODES = {'what_if_stopped': 1}


def events_of(kind):
    """The events of one kind in all bags."""
    return [
        event for events in EVENTS.values() for event in events if event['kind'] == CONSTANTS[kind]
    ]


def values(kind, field):
    return {event[field] for event in events_of(kind)}


@pytest.fixture(name='results', scope='module')
def run_the_commands():
    return readings.texts()


def test_no_bag_and_no_expectation_is_missing():
    assert len(NAMES) >= 15
    assert set(NAMES) == set(EVENTS) == set(TOPICS) == set(MACHINES)


def test_the_bags_have_every_kind_of_event():
    kinds = range(CONSTANTS['TRIAL_START'], CONSTANTS['WARNING'] + 1)
    assert {event['kind'] for events in EVENTS.values() for event in events} == set(kinds)
    assert len(kinds) == 23


def test_the_bags_have_every_failure_decision_and_answer():
    failures = range(CONSTANTS['FAILING_OUTCOME'], CONSTANTS['TIME_LIMIT'] + 1)
    assert values('FAILURE', 'failure_kind') == set(failures)
    assert values('DECISION', 'failure_class') == {
        CONSTANTS[name] for name in ('LOW', 'MODERATE', 'HIGH')
    }
    assert values('DECISION', 'outcome') == {'revisit', 'step_back', 'ask'}
    assert values('PRECONDITION_END', 'outcome') == {'met', 'not met'}
    assert values('QUERY_ANSWERED', 'outcome') == {'goto', 'supersede', 'give_up', 'interface'}


@pytest.mark.parametrize(
    'text',
    ['KeyboardInterrupt:', 'SystemExit:', 'ended without an outcome', 'InvalidTransitionError:'],
)
def test_a_trial_has_ended_with_this_text(text):
    assert any(end.startswith(text) for end in values('TRIAL_END', 'text'))


def test_max_recoveries_has_decided_where_the_policy_would_not_have_asked():
    spent = [event for event in events_of('DECISION') if event['text'].endswith(' spent on it')]
    assert CONSTANTS['LOW'] in {event['failure_class'] for event in spent}


def test_trials_have_ended_with_what_was_learned():
    assert any('"learned"' in data for data in values('TRIAL_END', 'data'))


@pytest.mark.parametrize('reader', sorted(READERS))
@pytest.mark.parametrize('name', NAMES)
def test_every_message_unpacks_by_the_definitions_in_the_bag(name, reader):
    messages = READERS[reader](DATA / name)
    assert held_trials.topics(messages) == TOPICS[name]
    assert held_trials.events(messages) == EVENTS[name]


def test_the_statistics_are_those_of_then():
    assert not list(lacking(expected('statistics'), readings.statistics()))


@pytest.mark.parametrize('name', sorted(readings.TEXTS))
def test_a_command_prints_the_figures_of_then(name, results):
    text = (EXPECTED / (name + '.txt')).read_text(encoding='utf-8')
    command, _, printed = text.partition('\n')
    assert command == '$ ' + ' '.join(readings.TEXTS[name])
    result = results[name]
    assert result.code == CODES.get(name, int(printed.split()[-1])), result.errors
    assert numbers(without_person_needed(result.text)) == numbers(printed)[:-1], result.text


def test_the_machines_and_the_frames_in_the_bags_are_those_of_then():
    assert not list(lacking(MACHINES, readings.machines()))


def test_a_bag_that_was_cut_off_is_not_read_as_one_of_then(tmp_path):
    (tmp_path / 'other.bag').write_bytes((DATA / NAMES[0]).read_bytes()[:5000])
    assert run('bag_statistics', str(tmp_path)).code == 2
