"""What /diagnostics and roswtf say about an oracle."""

import os
import sys

import pytest
from diagnostic_msgs.msg import DiagnosticStatus

from smach_oracle.msg import ExpertQueryGoal, OpenQuery, RecorderStatus
from smach_oracle.oracle.records.visits import StateRateRow
from smach_oracle.ros.diagnostics import roswtf_plugin, statuses

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


def values(status):
    return {each.key: each.value for each in status.values}


def test_a_question_of_this_node_is_a_warning_one_of_another_is_not():
    own = OpenQuery(
        query=ExpertQueryGoal(
            query_id='q1', robot='/robot', container_path='FETCH', failed_state='PICK'
        ),
        age=12.3,
    )
    other = OpenQuery(query=ExpertQueryGoal(query_id='q2', robot='/other'))
    told = statuses.questions_status('/robot', [own, other])
    assert (told.level, told.name, told.message) == (
        WARN,
        'robot: oracle questions',
        '1 open question',
    )
    assert values(told) == {'q1': 'PICK of FETCH, for 12 s'}
    assert statuses.questions_status('/robot', [other]).level == OK


def test_only_states_in_class_high_are_a_warning():
    rows = [
        StateRateRow('FETCH', name, rate, kind, 1, 1, 0, False)
        for name, rate, kind in (('PICK', 0.83, 3), ('LOOK', 0.4, 2), ('GO', 0.0, 1))
    ]
    told = statuses.states_status('/robot', rows)
    assert told.level == WARN and values(told) == {'FETCH/PICK': 'failure rate 0.83'}
    assert statuses.states_status('/robot', rows[1:]).level == OK


@pytest.mark.parametrize(
    'status, level',
    [
        (None, OK),
        (RecorderStatus(state=RecorderStatus.RECORDING), OK),
        (RecorderStatus(state=RecorderStatus.DROPPING, text='no space left'), ERROR),
        (RecorderStatus(state=RecorderStatus.IDLE, events_lost_in_total=3), WARN),
    ],
)
def test_a_recorder_that_loses_events_is_an_error_and_stays_a_warning(status, level):
    told = statuses.recorder_status('/robot', status)
    assert told.level == level and told.message
    assert not (status and status.text) or told.message == status.text


def test_a_store_that_is_behind_is_an_error():
    told = statuses.store_status('/robot', {'fetch.db': 'disk full'}, 1)
    assert told.level == ERROR and values(told) == {'fetch.db': 'disk full'}
    assert statuses.store_status('/robot', {}, 1).message == '1 store up to date'
    assert statuses.store_status('/robot', {}, 0).level == OK


def test_roswtf_repeats_what_the_oracles_tell_and_nobody_else():
    heard = {
        'a': statuses.store_status('/robot', {'fetch.db': 'disk full'}, 1),
        'b': DiagnosticStatus(level=ERROR, name='motor', hardware_id='base'),
    }
    assert roswtf_plugin.told_by_nodes(ERROR, heard) == [
        'robot: oracle store: 1 store behind: a crash now would lose steps (fetch.db: disk full)'
    ]
    assert roswtf_plugin.told_by_nodes(WARN, heard) == []


def test_roswtf_names_what_is_missing_and_a_mixed_engine(monkeypatch, tmp_path):
    # a checkout of upstream's engine alone leaves our messages in their place: that is mixed
    ours = ['smach_msgs'] if os.environ.get('SMACH_UPSTREAM') else []
    assert roswtf_plugin.mixed_engine(None) == ours
    monkeypatch.setitem(sys.modules, 'cv2', None)
    assert [each for each in roswtf_plugin.lacking_packages(None) if each.startswith('cv2: no ')]
    for name, marked in (('theirs', False), ('ours', True)):
        (tmp_path / name).mkdir()
        (tmp_path / name / '__init__.py').write_text('')
        if marked:
            (tmp_path / name / '.smach_oracle_stand_in').touch()
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(roswtf_plugin, 'STAND_INS', ('theirs', 'ours'))
    assert roswtf_plugin.mixed_engine(None) == ['ours']
