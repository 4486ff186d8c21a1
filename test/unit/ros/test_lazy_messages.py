"""The generated messages: each is imported when it is first asked for, and all are there."""

import subprocess
import sys
from pathlib import Path

import pytest
import roslib.message

import smach_oracle.msg
import smach_oracle.srv

ROOT = Path(__file__).resolve().parents[3]
MESSAGES = sorted(path.stem for path in (ROOT / 'msg').glob('*.msg'))
SERVICES = sorted(path.stem for path in (ROOT / 'srv').glob('*.srv'))
LOADED = """
import sys
{}
ours = ('smach_oracle.msg._', 'smach_oracle.srv._')
print(*[name for name in sys.modules if name.startswith(ours)])
"""


def loaded_by(line):
    told = subprocess.run(
        [sys.executable, '-c', LOADED.format(line)], check=True, stdout=subprocess.PIPE, timeout=60
    )
    # before it stands what smach logs
    return {name.split('._')[1] for name in told.stdout.decode().splitlines()[-1].split()}


def test_a_message_brings_in_itself_and_what_it_consists_of():
    assert loaded_by('import smach_oracle.msg, smach_oracle.srv') == set()
    assert loaded_by('from smach_oracle.msg import StateRate') == {'StateRate'}
    goal = {'ExpertQueryActionGoal', 'ExpertQueryGoal'}
    made = loaded_by('from smach_oracle.msg import ExpertQueryActionGoal as Goal; Goal()')
    assert goal <= made and len(made) < 10
    assert loaded_by('from smach_oracle.srv import PassTimeResponse') == {'PassTime'}


EXECUTED = """
import smach
from smach_oracle import OracleContainer
machine = smach.StateMachine(['succeeded'])
with machine:
    smach.StateMachine.add('A', smach.CBState(lambda data: 'succeeded', outcomes=['succeeded']))
OracleContainer.wrap(machine).execute()
"""
LIBRARIES = """
import sys
from smach_oracle import OracleContainer
libraries = {'actionlib', 'sensor_msgs', 'smach_msgs'}
print(OracleContainer.__name__, *libraries.intersection(sys.modules))
"""


def test_a_machine_that_is_executed_brings_in_none_of_the_simulated_robot():
    loaded = loaded_by(EXECUTED)
    assert 'OracleEvent' in loaded and len(loaded) < 60
    assert not loaded & {'PickAction', 'DetectDrinkAction', 'ResetWorld'}


def test_the_oracle_alone_brings_in_no_message_and_no_action():
    assert loaded_by('from smach_oracle import OracleContainer; OracleContainer') == set()
    told = subprocess.run(
        [sys.executable, '-c', LIBRARIES], check=True, stdout=subprocess.PIPE, timeout=60
    )
    assert told.stdout.decode().split() == ['OracleContainer']


@pytest.mark.parametrize('name', MESSAGES)
def test_every_message_is_there(name):
    found = getattr(smach_oracle.msg, name)
    assert found._type == 'smach_oracle/' + name and name in dir(smach_oracle.msg)
    assert roslib.message.get_message_class('smach_oracle/' + name) is found


@pytest.mark.parametrize('name', SERVICES)
def test_every_service_is_there(name):
    found = getattr(smach_oracle.srv, name)
    assert found._request_class is getattr(smach_oracle.srv, name + 'Request')
    assert found._response_class is getattr(smach_oracle.srv, name + 'Response')
    assert roslib.message.get_service_class('smach_oracle/' + name) is found


def test_all_come_with_a_star_and_nothing_else_does():
    space = {}
    exec('from smach_oracle.msg import *', space)
    assert set(MESSAGES) < set(space) and 'PickAction' in space
    with pytest.raises(ImportError):
        exec('from smach_oracle.msg import NoSuchMessage', space)
    assert not hasattr(smach_oracle.srv, 'NoSuchService')
