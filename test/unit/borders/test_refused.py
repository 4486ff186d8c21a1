"""What once came past a border: each is refused now, or taken for what it is."""

import io
import math
import sqlite3
from types import SimpleNamespace

import pytest
import tornado.web
from borders.fake_ros import fake_ros
from borders.files import machine, stored
from borders.robot_goals import a_mug_many_times, servers
from crafted_bags import crafted_bag, event
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from prompt_toolkit.document import Document
from prompt_toolkit.validation import ValidationError
from std_msgs.msg import Bool

import smach
from smach_oracle.analysis.replaying.checks import that_count
from smach_oracle.analysis.trials import load_trials
from smach_oracle.expert.console.feeds.views import event_of
from smach_oracle.expert.console.web.handlers import SessionHandler
from smach_oracle.expert.rules import Rules
from smach_oracle.expert.scripted_expert import load_rules
from smach_oracle.expert.terminal.prompts import JsonValidator
from smach_oracle.expert.wording import next_step_words
from smach_oracle.interfaces.manipulation.settings import _state
from smach_oracle.msg import OracleEvent
from smach_oracle.oracle.errors import CheckpointError, SettingsError
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.oracle.records.short_text import LEFT_OUT
from smach_oracle.oracle.settings.health import checked_health
from smach_oracle.pr2.planning.collision_map import MOST_BOXES
from smach_oracle.ros.health.field_rules import why_unwell_by_message
from smach_oracle.ros.health.health_topics import HealthTopics
from smach_oracle.ros.loaded_settings import read_yaml
from smach_oracle.store import state_command
from smach_oracle.store.store_file import StoreFile

DEEP = '[' * 4000


@pytest.mark.parametrize('text', ['memory: !!bool x', 'memory: !!timestamp x'])
def test_a_value_that_is_not_what_its_tag_says_is_no_yaml(tmp_path, text):
    path = tmp_path / 'settings.yaml'
    path.write_text(text)
    with pytest.raises(SettingsError, match='settings.yaml: .*YAML'):
        read_yaml(str(path))
    with pytest.raises(SettingsError, match='a YAML file of rules'):
        load_rules(None, str(path))


def test_an_arm_and_the_kind_of_a_rule_are_words():
    with pytest.raises(SettingsError, match=r'~states/PICK/arm: \[\] is not allowed'):
        _state('PICK', {'arm': []}, {'left': None})
    with pytest.raises(SettingsError, match=r'PICK.kind: \[\] is not allowed'):
        Rules.parse({'PICK': {'kind': []}})


@pytest.mark.parametrize('time_s', [math.nan, math.inf, -1.0, 1e300])
def test_a_robot_without_a_clock_does_not_stop_the_console(time_s):
    assert event_of(OracleEvent(wall_time=time_s)).wall_time == 0.0
    assert event_of(OracleEvent(wall_time=7.0)).wall_time == 7.0


def test_json_that_is_nested_too_deep_is_none():
    jump = OracleEvent(kind=OracleEvent.JUMP, target='A', data=DEEP)
    assert event_of(jump).data == {}
    assert next_step_words(jump) == 'The machine goes to A.'
    with pytest.raises(ValidationError, match='not JSON'):
        JsonValidator().validate(Document(DEEP))
    with pytest.raises(tornado.web.HTTPError, match='400'):
        SessionHandler._token(SimpleNamespace(request=SimpleNamespace(body=DEEP.encode())))


@pytest.mark.parametrize('stored_seq', [None, 'x', [1], 1.5])
def test_a_resumed_trial_that_does_not_say_what_was_stored_is_counted(tmp_path, stored_seq):
    resumed = event(kind=EventKind.RESUMED, seq=5, data={'last_seq': stored_seq})
    (tmp_path / 't.bag').write_bytes(crafted_bag(resumed))
    (trial,) = load_trials([str(tmp_path)]).trials
    assert trial.trial_id == resumed.trial_id
    assert that_count([event(), resumed]) == [event(), resumed]


@pytest.fixture
def store(tmp_path):
    """A store with a trial that was stopped, and a function that changes one of its facts."""
    path = tmp_path / 'robot.db'
    path.write_bytes(stored())

    def change(name, text):
        with sqlite3.connect(str(path)) as database:
            (last,) = database.execute('SELECT max(number) FROM moments').fetchone()
            database.execute("DELETE FROM facts WHERE path = 'task' AND name = ?", (name,))
            database.execute("INSERT INTO facts VALUES (?, 'task', ?, ?, NULL)", (last, name, text))
        database.close()

    return str(path), change


@pytest.mark.parametrize('name, text', [('at', '7'), ('at', '[1]'), ('at', 'x'), ('asked', '1')])
def test_a_store_that_makes_no_sense_is_refused_by_its_name(store, monkeypatch, name, text):
    path, change = store
    change(name, text)
    said = io.StringIO()
    monkeypatch.setattr('sys.stderr', said)
    assert state_command.main([path, 'show']) == 2
    assert said.getvalue().startswith('oracle_state: ' + path + ': ')
    with pytest.raises(CheckpointError, match='robot.db: .*'):
        machine(checkpoint=path, on_resume='recover').execute()


def test_what_a_store_says_of_a_state_must_make_sense(store):
    path, change = store
    change('state:A', '[]')
    with pytest.raises(CheckpointError, match='robot.db: is damaged'):
        machine(checkpoint=path, on_resume='recover').execute()


def test_a_store_that_was_refused_is_let_go_of(store):
    path, change = store
    change('at', '7')
    for _ in range(2):
        with pytest.raises(CheckpointError):
            machine(checkpoint=path, on_resume='recover').execute()


def test_a_key_that_is_no_utf_8_is_kept_out_and_the_rest_is_stored(tmp_path, monkeypatch):
    said = []
    monkeypatch.setattr(smach, 'logwarn', said.append)
    path = str(tmp_path / 'robot.db')
    made = machine(checkpoint=path, checkpoint_synchronous='OFF')
    made.userdata['photo\udce9'] = 1
    assert made.execute() == 'done'
    assert [text for text in said if 'udce9' in text and 'no text in UTF-8' in text]
    with_trial = StoreFile(path, read_only=True)
    (trial,) = with_trial.trials()
    assert trial.outcome == 'done'
    names = {fact.name for fact in with_trial.facts(trial.number)}
    assert 'key:cups' in names and 'out:photo\\udce9' in names


@pytest.mark.parametrize('given', [DEEP, '{"a": ' + DEEP])
def test_json_that_is_nested_too_deep_is_not_put_into_a_store(store, capsys, given):
    path, _ = store
    assert state_command.main([path, 'edit', 'cups=' + given]) == 2
    assert 'is no JSON' in capsys.readouterr().err


@pytest.mark.parametrize('field', ['data.\u00b2', 'data.' + '9' * 5000])
def test_a_field_that_is_almost_a_place_in_a_list_is_none(field):
    (condition,) = checked_health('healthy', {'topic': '/t', 'field': field})
    assert why_unwell_by_message(condition, Bool(True)) == '/t has no field ' + field


@pytest.mark.parametrize(
    'wanted, ends', [({'at_least': 0}, "x00' is no number"), ({'equals': 'on'}, "x00'")]
)
def test_of_a_field_that_is_a_whole_image_only_head_and_tail_are_told(wanted, ends):
    (condition,) = checked_health('healthy', dict(wanted, topic='/t'))
    why = why_unwell_by_message(condition, SimpleNamespace(data=bytes(100000)))
    assert LEFT_OUT in why and why.endswith(ends)
    assert len(why) < 300


def test_diagnostics_of_another_type_are_passed_over(monkeypatch):
    monkeypatch.setattr(HealthTopics, '_subscribe', lambda self: None)
    with fake_ros():
        topics = HealthTopics()
        latest = topics.status('Power')
        topics._take_diagnostics(Bool(True))
        assert latest.age_s() is None
        topics._take_diagnostics(DiagnosticArray(status=[DiagnosticStatus(name='Power')]))
        assert latest.newest().what.level == 0


def test_a_collision_map_has_no_end_of_objects():
    server = servers()['build_collision_map']
    for count, end in ((MOST_BOXES, 'taken'), (MOST_BOXES + 1, 'refused')):
        with fake_ros():
            server.execute(a_mug_many_times(count))
        assert server.end[0] == end
    assert server.end[1] == '601 objects; allowed: at most 600'
