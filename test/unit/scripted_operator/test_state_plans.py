"""What the scripted operator is told to do about which state."""

import pytest

from smach_oracle.oracle.errors import SettingsError
from smach_oracle.scripted_operator.state_plans import StatePlan, StatePlans, missing

BOTH = ['perception', 'manipulation']


def test_a_state_gets_its_own_means_and_others_the_default():
    plans = StatePlans(
        {'PICK': {'means': 'take', 'arm': 'left', 'what': 'objects'}, 'default': {'means': 'retry'}}
    )
    assert plans.of('PICK') == StatePlan('take', 'left', 'objects')
    assert plans.of('DRIVE').means == 'retry' and StatePlans({}).of('DRIVE').means == 'retry'


@pytest.mark.parametrize(
    'means, offered, lacking',
    [
        ('take', ['hand', 'perception'], 'manipulation'),
        ('show', [], 'perception'),
        ('put_down', BOTH, ''),
        ('retry', [], ''),
    ],
)
def test_an_interface_is_known_by_the_name_under_which_it_is_offered(means, offered, lacking):
    assert missing(StatePlan(means), offered) == lacking


@pytest.mark.parametrize(
    'settings, says',
    [
        (7, 'states'),
        ({'PICK': 'take'}, 'PICK'),
        ({'PICK': {'means': 'dance'}}, 'PICK.means'),
        ({'PICK': {'means': ['take']}}, 'PICK.means'),
        ({'PICK': {'means': {'take': 1}}}, 'PICK.means'),
        ({'PICK': {'means': 'take', 'arms': 'left'}}, 'PICK.arms'),
        ({'PICK': {'means': 'take', 'arm': 'third'}}, 'PICK.arm'),
        ({'PLACE': {'means': 'put_down'}}, 'either place or onto'),
        ({'PICK': {'means': 'take', 'tries': 0}}, 'PICK.tries'),
        ({'PICK': {'means': 'take', 'inside': 'yes'}}, 'PICK.inside'),
        ({'PICK': {'means': 'take', 'what': 3}}, 'PICK.what'),
        ({'PICK': {'means': 'take', 'base': [1, 2]}}, 'PICK.base'),
        ({'PICK': {'means': 'take', 'base': [True, 0, 0]}}, 'PICK.base'),
        ({'PICK': {'means': 'take', 'base': [9, 0, 0]}}, 'PICK.base'),
        ({'PICK': {'means': 'take', 'look': [0.6, 0.1, 0.7]}}, 'PICK.look'),
        ({'PICK': {'means': 'take', 'look': 'up'}}, 'PICK.look'),
    ],
)
def test_settings_that_cannot_be_are_refused_by_name(settings, says):
    with pytest.raises(SettingsError, match=says):
        StatePlans(settings)


def test_where_to_look_and_how_to_drive_are_numbers():
    settings = {'means': 'take', 'base': [0.1, 0, 0], 'look': [[1, 0, 0.7]]}
    plan = StatePlans({'PICK': settings}).of('PICK')
    assert plan.base == (0.1, 0.0, 0.0) and plan.look == ((1.0, 0.0, 0.7),)
