"""The second robot's launch file: what it starts, and the settings that it gives to the oracle."""

import ast

import pytest
import yaml
from roslaunch.config import load_config_default
from roslaunch.substitution_args import resolve_args

from smach_oracle.inspection_robot import checks
from smach_oracle.inspection_robot.site import PANELS, before_panel
from smach_oracle.oracle.settings.settings import Settings
from smach_oracle.tasks import inspection

ROBOT = {'inspection_world', 'inspection_navigator', 'inspection_inspector'}
TASKS = '$(find smach_oracle)/src/smach_oracle/tasks/inspection'


def launched(*arguments):
    """What roslaunch would start."""
    path = resolve_args('$(find smach_oracle)/launch/inspection.launch')
    return load_config_default([(path, list(arguments))], 11311, verbose=False)


@pytest.mark.parametrize(
    'arguments, who_answers',
    [
        ((), {'scripted_expert'}),
        (('console:=true',), {'expert_console'}),
        (('scripted_expert:=false',), set()),
        (('console:=true', 'scripted_expert:=true'), {'expert_console', 'scripted_expert'}),
    ],
)
def test_the_robot_and_whoever_answers_are_started(arguments, who_answers):
    config = launched(*arguments)
    assert {node.type for node in config.nodes} == ROBOT | {'oracle_run'} | who_answers
    assert config.params['/use_sim_time'].value is True


def test_the_cameras_image_goes_with_every_question():
    config = launched()
    assert config.params['/inspection/failure_cameras'].value == ['camera/image_raw']


def test_without_the_oracle_the_same_script_runs():
    (node,) = [node for node in launched('with_oracle:=false').nodes if node.type == 'oracle_run']
    assert '--without-oracle' in node.args and 'inspection.py' in node.args


def test_the_settings_name_checks_that_are_there_and_states_of_the_script():
    with open(resolve_args(TASKS + '.yaml'), encoding='utf-8') as stream:
        given = yaml.safe_load(stream)
    used = []

    def resolve(name):
        used.append(name.rsplit(':', 1)[1])
        return getattr(checks, used[-1])

    Settings.from_dict(given, resolve)
    assert 'wait_for_motors' in used and 'light_is_fair' in used
    at_place = {'LOCALISE', 'DRIVE', 'INSPECT', 'REPORT'}
    labels = {
        each
        for state in given['states'].values()
        for each in state['preconditions']
        if isinstance(each, str) and not each.startswith('python:')
    }
    assert set(given['states']) | labels <= at_place


def test_the_script_says_no_word_of_the_oracle():
    with open(resolve_args(TASKS + '.py'), encoding='utf-8') as stream:
        text = stream.read()
    names = {
        alias.name
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Import)
        for alias in node.names
    }
    assert 'smach' in names
    assert text.count('smach_oracle') == 1, 'the line that says what starts its robot'


def test_every_place_is_before_a_panel_of_the_hall():
    poses = {panel.number: before_panel(panel, 1.5) for panel in PANELS}
    for place in inspection.PLACES:
        pose = (place['x'], place['y'], place['yaw'])
        assert pose == pytest.approx(poses[place['panel']], abs=1e-9)
