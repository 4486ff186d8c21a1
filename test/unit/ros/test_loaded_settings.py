"""Settings from a file, the parameter server and the command line; every mistake says where it was
made.
"""

import sys
import types

import pytest

from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.settings.settings import Settings
from smach_oracle.ros import loaded_settings as settings_module
from smach_oracle.ros.loaded_settings import (
    LoadedSettings,
    load_settings,
    read_param,
    read_yaml,
    resolve_python,
)


class FakeParameterServer:
    """Answers rospy.get_param from a dictionary."""

    def __init__(self, values):
        self.values = values

    def get_param(self, name, default):
        return self.values.get(name, default)


@pytest.fixture
def write(tmp_path):
    def write_file(text):
        path = tmp_path / 'oracle.yaml'
        path.write_text(text)
        return str(path)

    return write_file


@pytest.fixture
def node(monkeypatch):
    """This process looks like the ROS node /robot with the given parameters."""

    def be_node(**values):
        server = FakeParameterServer({'~' + name: value for name, value in values.items()})
        monkeypatch.setattr(settings_module.rospy, 'get_param', server.get_param)
        monkeypatch.setattr(settings_module.rospy.core, 'is_initialized', lambda: True)
        monkeypatch.setattr(
            settings_module.rospy, 'resolve_name', lambda name: name.replace('~', '/robot/')
        )

    return be_node


def test_a_file_is_read_as_it_is_written(write):
    path = write('policy: prose\nstates:\n  PICK: {memory: 4, preconditions: [DETECT]}\n')
    assert load_settings(path) == {
        'policy': 'prose',
        'states': {'PICK': {'memory': 4, 'preconditions': ['DETECT']}},
    }


def test_an_empty_file_sets_nothing(write):
    assert load_settings(write('# nothing here\n')) == {}


def test_a_missing_file_is_named():
    with pytest.raises(SettingsError, match='^settings file: no such file: no_such_file.yaml$'):
        read_yaml('no_such_file.yaml')


def test_a_file_that_is_no_mapping_is_refused(write):
    with pytest.raises(SettingsError, match='a mapping of settings'):
        read_yaml(write('- policy\n- prose\n'))


def test_a_syntax_error_names_its_line(write):
    with pytest.raises(SettingsError, match=r'oracle\.yaml line [23]: '):
        read_yaml(write('policy: prose\nstates: {PICK: [\n'))


def test_a_file_that_is_no_text_is_refused(tmp_path):
    path = tmp_path / 'oracle.yaml'
    path.write_bytes(b'\xff\xfe\x00')
    with pytest.raises(SettingsError, match='readable YAML file'):
        read_yaml(str(path))


@pytest.mark.parametrize(
    'text', ['states: &a {PICK: *a}\n', 'x: ' + '[' * 3000 + '\n', 'memory: !!int many\n']
)
def test_a_file_that_no_yaml_reader_can_make_sense_of_is_refused_by_name(write, text):
    with pytest.raises(SettingsError, match=r'oracle\.yaml'):
        read_yaml(write(text))


def test_an_object_from_a_file_is_never_made(write):
    with pytest.raises(SettingsError, match='line 1'):
        read_yaml(write('policy: !!python/object/apply:os.getcwd []\n'))


@pytest.mark.parametrize(
    'text, place',
    [
        ('memory: 3\nprior: 0.1\nmemory: 4\n', r'line 3: memory: .*first in line 1'),
        (
            'states:\n  PICK: {memory: 3}\n  PLACE: {}\n  PICK: {prior: 0.2}\n',
            r'line 4: states\.PICK: .*first in line 2',
        ),
        (
            'states:\n  A:\n    preconditions:\n    - {check: B, check: C}\n',
            r'line 4: states\.A\.preconditions\[0\]\.check',
        ),
    ],
)
def test_a_key_given_twice_names_both_lines(write, text, place):
    with pytest.raises(SettingsError, match=place):
        read_yaml(write(text))


def test_the_same_key_in_different_mappings_is_no_repetition(write):
    values, lines = read_yaml(write('memory: 3\nstates:\n  A: {memory: 4}\n  B: {memory: 5}\n'))
    assert values['states']['B']['memory'] == 5
    assert (lines['memory'], lines['states.A.memory'], lines['states.B.memory']) == (1, 3, 4)


def test_anchors_and_merge_keys_work(write):
    values, _ = read_yaml(
        write('states:\n  A: &usual {memory: 4}\n  B:\n    <<: *usual\n    prior: 0.3\n')
    )
    assert values['states']['B'] == {'memory': 4, 'prior': 0.3}


def test_a_wrong_value_names_file_line_key_value_and_what_is_allowed(write):
    path = write('policy: prose\nstates:\n  PICK:\n    memory: many\n')
    settings = load_settings(path)
    with pytest.raises(SettingsError) as caught:
        Settings.from_dict(settings)
    text = str(settings.located(caught.value))
    for part in ('oracle.yaml line 4', 'states.PICK.memory', "'many'", 'a whole number'):
        assert part in text


def test_the_parameter_server_goes_over_the_file_and_the_command_line_over_both(write, node):
    path = write('policy: prose\nmemory: 3\nstates:\n  PICK: {memory: 4, prior: 0.3}\n')
    node(oracle={'memory': 5, 'states': {'PICK': {'memory': 6}}, 'expert': {'deadline_s': 7.0}})
    settings = load_settings(path, overrides={'expert': {'deadline_s': 8.0}})
    assert settings == {
        'policy': 'prose',
        'memory': 5,
        'expert': {'deadline_s': 8.0},
        'states': {'PICK': {'memory': 6, 'prior': 0.3}},
    }
    assert settings.origin('memory') == 'parameter /robot/oracle'
    assert settings.origin('expert.deadline_s') == 'command line'
    assert 'line 4' in settings.origin('states.PICK.prior')


def test_the_file_is_not_changed_by_what_goes_over_it():
    values = {'states': {'PICK': {'memory': 4}}}
    settings = LoadedSettings(values)
    settings.put({'states': {'PICK': {'memory': 5}}}, 'command line')
    assert values == {'states': {'PICK': {'memory': 4}}}


def test_a_parameter_that_is_no_mapping_is_refused(node):
    node(oracle='prose')
    with pytest.raises(SettingsError, match="parameter /robot/oracle: 'prose'.*mapping"):
        read_param('~oracle')


def test_a_state_of_a_nested_machine_can_be_set_by_parameter(node):
    # set_param('~oracle', {'states': {'TASK/PICK': ...}}) comes back as states/TASK/PICK
    node(
        oracle={
            'states': {
                'TASK': {'memory': 3, 'PICK': {'memory': 4}, 'ARM': {'MOVE': {'prior': 0.2}}},
                'X': {},
            }
        }
    )
    assert read_param('~oracle').values['states'] == {
        'TASK': {'memory': 3},
        'TASK/PICK': {'memory': 4},
        'TASK/ARM/MOVE': {'prior': 0.2},
        'X': {},
    }


def refuse(name, default):
    raise ConnectionRefusedError('nobody there')


def test_an_unreachable_master_does_not_keep_the_robot_from_starting(node, monkeypatch):
    node()
    monkeypatch.setattr(settings_module.rospy, 'get_param', refuse)
    assert read_param('~oracle').values == {}


@pytest.mark.parametrize('is_there', [False, True])
def test_what_was_read_stays_where_the_master_forgets_it(node, monkeypatch, is_there):
    node(oracle={'memory': 3})
    assert read_param('~oracle').values == {'memory': 3}
    if is_there:  # it was started again
        node()
    else:
        monkeypatch.setattr(settings_module.rospy, 'get_param', refuse)
    assert read_param('~oracle').values == {'memory': 3}
    node(oracle={'memory': 4})
    assert read_param('~oracle').values == {'memory': 4}


def test_without_a_node_no_parameter_is_asked_for(write):
    assert load_settings(write('memory: 2')) == {'memory': 2}


@pytest.fixture
def checks_module(monkeypatch):
    module = types.ModuleType('robot_checks')
    module.view_is_clear = lambda userdata: True

    class Home:
        def execute(self, userdata):
            return 'succeeded'

        def get_registered_outcomes(self):
            return ('succeeded',)

    module.Home = Home
    module.arm = types.SimpleNamespace(is_parked=module.view_is_clear)
    monkeypatch.setitem(sys.modules, 'robot_checks', module)
    return module


def test_a_precondition_can_be_named_by_module_and_attribute(checks_module):
    assert resolve_python('python:robot_checks:view_is_clear') is checks_module.view_is_clear
    assert resolve_python('python:robot_checks:arm.is_parked') is checks_module.view_is_clear


def test_a_state_class_named_as_a_precondition_becomes_a_state(checks_module):
    assert isinstance(resolve_python('python:robot_checks:Home'), checks_module.Home)


@pytest.mark.parametrize(
    'name, reason',
    [
        ('python:robot_checks', 'the form is'),
        ('python::view', 'the form is'),
        ('robot_checks:view_is_clear', 'python:module:attribute'),
        ('python:robot_checks:blind', "has no 'blind'"),
        ('python:no_such_module_here:view', 'no_such_module_here'),
    ],
)
def test_a_name_that_leads_nowhere_says_why(checks_module, name, reason):
    with pytest.raises((ValueError, ImportError), match=reason):
        resolve_python(name)


def test_the_key_is_named_where_a_precondition_cannot_be_imported(write, checks_module):
    settings = load_settings(
        write('states:\n  PICK:\n    preconditions: ["python:robot_checks:blind"]\n')
    )
    with pytest.raises(SettingsError) as caught:
        Settings.from_dict(settings, resolve_python)
    text = str(settings.located(caught.value))
    assert 'line 3' in text and 'states.PICK.preconditions' in text and "has no 'blind'" in text


def test_what_a_parameter_overrides_is_named():
    settings = LoadedSettings(
        {'max_recoveries': 5, 'memory': 10, 'states': {'PICK': {'prior': 0.2}}}
    )
    assert settings.overridden_by(
        {
            'max_recoveries': 0,
            'memory': 10,
            'expert': {'deadline_s': 3.0},
            'states': {'PICK': {'prior': 0.3}},
        }
    ) == ['max_recoveries: 5, now 0', 'states.PICK.prior: 0.2, now 0.3']


@pytest.mark.parametrize(
    'before, now, both',
    [
        ('{name: ladder, wait_s: 1}', {'name': 'restart'}, {'name': 'restart'}),
        ('{name: ladder, wait_s: 1}', {'tries': 2}, {'name': 'ladder', 'wait_s': 1, 'tries': 2}),
        (
            '{name: ladder, wait_s: 1}',
            {'name': 'ladder', 'tries': 2},
            {'name': 'ladder', 'wait_s': 1, 'tries': 2},
        ),
        ('ladder', {'name': 'ladder', 'tries': 2}, {'name': 'ladder', 'tries': 2}),
    ],
)
def test_a_policy_of_another_name_takes_the_place_of_one(write, node, before, now, both):
    node(oracle={'policy': now})
    settings = load_settings(write('policy: {}'.format(before)))
    assert settings['policy'] == both
    assert Settings.from_dict(settings).policy == both['name']


@pytest.mark.parametrize('key', ['on_no_answer: {}', 'expert: {{on_no_answer: {}}}'])
def test_another_fallback_takes_the_place_of_one(write, node, key):
    node(oracle={'expert': {'on_no_answer': {'give_up': 'parked'}}})
    settings = load_settings(write(key.format('{goto: HOME}')))
    assert settings['expert']['on_no_answer'] == {'give_up': 'parked'}
