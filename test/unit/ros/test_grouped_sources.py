"""Settings in groups from several sources: an older key is told, and means the same setting."""

import logging
import subprocess
import sys

import pytest
from borders.settings import parameters_are
from drawn_settings import QUICK, drawn_settings, taken
from hypothesis import given, settings
from hypothesis import strategies as st

from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.settings.settings import GROUPS, Settings
from smach_oracle.ros.loaded_settings import LoadedSettings, in_groups, load_settings
from smach_oracle.ros.log.said_once import warn_once


@pytest.fixture
def write(tmp_path):
    def write_file(text, name='oracle.yaml'):
        path = tmp_path / name
        path.write_text(text, encoding='utf-8')
        return str(path)

    return write_file


@pytest.fixture
def run_python():
    def run(text):
        done = subprocess.run(
            [sys.executable, '-c', text], stderr=subprocess.PIPE, check=True, timeout=60
        )
        return done.stderr.decode()

    return run


@pytest.fixture
def warned(caplog, monkeypatch):
    """What is said of older keys, as if nothing had been before.

    Threads of other tests may log something else meanwhile.
    """
    monkeypatch.setattr(warn_once, '_said', set())
    monkeypatch.setattr(logging.getLogger('rosout'), 'propagate', True)
    return lambda: [text for text in map(str, caplog.messages) if ' is now called ' in text]


def read(loaded):
    try:
        return Settings.from_dict(loaded, lambda name: parameters_are)
    except SettingsError as err:
        raise loaded.located(err) from err


def test_an_older_key_is_read_and_its_new_name_is_told_once(write, warned):
    path = write('memory: 3\ndeadline_s: 60\ncheckpoint: robot.db\non_resume: recover\n')
    for _ in range(2):
        found = read(load_settings(path))
        assert (found.deadline_s, found.on_resume) == (60.0, ('recover', ''))
    assert warned() == [
        path + ' line 2: deadline_s is now called expert.deadline_s',
        path + ' line 4: on_resume is now called checkpoint.on_resume',
    ]


def test_new_keys_and_the_short_forms_are_warned_of_nowhere(write, warned):
    path = write('expert: {deadline_s: 60}\ncheckpoint: robot.db\nhealthy: [{topic: /a}]\ntree:\n')
    found = read(load_settings(path))
    assert found.deadline_s == 60.0 and found.healthy and found.checkpoint.endswith('robot.db')
    assert not warned()


def test_in_code_the_name_of_a_field_is_no_older_key(warned):
    assert LoadedSettings({'deadline_s': 60}) == {'expert': {'deadline_s': 60}}
    assert not warned()


@pytest.mark.parametrize('older', ['deadline_s: 60', 'expert: {deadline_s: 60}'])
@pytest.mark.parametrize('newer', [{'deadline_s': 5}, {'expert': {'deadline_s': 5}}])
def test_a_stronger_source_overrides_a_key_under_either_name(write, older, newer):
    path = write(older + '\non_no_answer: {goto: HOME}\n')
    with parameters_are({'oracle': newer}):
        loaded = load_settings(path)
    found = read(loaded)
    assert (found.deadline_s, found.on_no_answer) == (5.0, ('goto', 'HOME'))
    assert loaded.origin('expert.deadline_s').startswith('parameter ')
    assert loaded.origin('expert.on_no_answer').endswith(' line 2')
    assert read(load_settings(path, overrides={'expert': {'deadline_s': 4}})).deadline_s == 4.0


def test_a_store_of_the_command_line_keeps_what_a_file_says_of_it(write):
    path = write('checkpoint: {file: a.db, wait_s: 3}\nresume_map: {OLD: NEW}\n')
    overrides = {'checkpoint': {'file': 'b.db', 'from': 7, 'map': {'OLDER': 'NEW'}}}
    found = read(load_settings(path, overrides=overrides))
    assert found.checkpoint.endswith('b.db')
    assert (found.checkpoint_wait_s, found.resume_from) == (3.0, 7)
    assert found.resume_map == {'OLD': 'NEW', 'OLDER': 'NEW'}


@pytest.mark.parametrize('given_there', ['c.db', {'file': 'c.db'}, {'file': 'c.db', 'wait_s': 2}])
def test_the_parameter_checkpoint_may_be_the_file_or_the_group(given_there):
    with parameters_are({'oracle': {'checkpoint': {'wait_s': 2}}, 'checkpoint': given_there}):
        found = read(load_settings())
    assert found.checkpoint.endswith('c.db') and found.checkpoint_wait_s == 2.0


@pytest.mark.parametrize(
    'text, told',
    [
        (
            'memory: 1\nexpert: [1]\n',
            ' line 2: expert: [1] is not allowed; allowed: a mapping',
        ),
        (
            'tree:\n  nestd: true\n',
            ' line 2: tree.nestd: no such setting (did you mean tree',
        ),
        ('deadline_s: -1\n', ' line 1: deadline_s: -1 is not allowed'),
        ('expert:\n  deadline_s: -1\n', ' line 2: expert.deadline_s: -1 is not allowed'),
        ('memory: 1\nhealthy:\n- {topic: /a}\n- {topic: a b}\n', ' line 4: healthy[1].topic: '),
        (
            'healthy:\n  settle_s: 1\n  conditions:\n  - {topic: a b}\n',
            ' line 4: healthy.conditions[0].topic: ',
        ),
        ('interfaces:\n  hand:\n    actoin: a\n', ' line 3: interfaces.hand.actoin: '),
        ('expert:\n  interfaces:\n    hand: {}\n', ' line 3: expert.interfaces.hand.action: '),
        ('resume_map:\n  A: B\n  C: [D]\n', ' line 3: resume_map.C: '),
    ],
)
def test_an_error_names_the_line_and_the_key_as_it_is_written(write, text, told):
    path = write(text)
    with pytest.raises(SettingsError) as caught:
        read(load_settings(path))
    assert str(caught.value).startswith(path + told)


def test_two_values_in_one_file_are_refused_and_in_two_sources_they_are_not(write):
    path = write('expert:\n  deadline_s: 30\ndeadline_s: 60\n')
    with pytest.raises(SettingsError) as caught:
        load_settings(path)
    assert str(caught.value) == (
        path + ' line 3: deadline_s: 60 and expert.deadline_s: 30 are one setting with two values; '
        'allowed: one value, under expert.deadline_s'
    )
    assert (
        read(load_settings(write('deadline_s: 30\nexpert: {deadline_s: 30.0}\n'))).deadline_s == 30
    )


def test_what_a_parameter_overrides_is_told_under_the_new_key():
    there = LoadedSettings({'deadline_s': 60, 'nested': True})
    over = in_groups({'deadline_s': 5.0, 'tree': {'nested': True}}, 'parameter')
    assert there.overridden_by(over.values) == ['expert.deadline_s: 60, now 5.0']


@settings(max_examples=300, **QUICK)
@given(st.lists(drawn_settings(), min_size=2, max_size=3))
def test_sources_are_merged_alike_whichever_of_their_keys_are_older(sources):
    grouped, flat = LoadedSettings(), LoadedSettings()
    for drawn in sources:
        grouped.put(*in_groups(drawn.source(), 'there'))
        flat.put(drawn.flat, 'there')  # as they were merged without groups
    assert set(grouped) <= set(GROUPS.top_keys())
    assert taken(grouped) == taken(flat)


def test_a_program_says_it_before_it_is_a_node(write, run_python):
    path = write('deadline_s: 60\n')
    told = run_python(
        'from smach_oracle.ros.loaded_settings import load_settings; load_settings({!r})'.format(
            path
        )
    )
    assert 'deadline_s is now called expert.deadline_s' in told, told
