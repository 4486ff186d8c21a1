"""Names that users import stay importable from where they were, with a warning."""

import importlib
import sys

import pytest

from smach_oracle.interfaces import interface_goal


def test_the_goal_of_an_interface_is_found_at_its_old_place_with_a_warning():
    sys.modules.pop('smach_oracle.expert.interface_goal', None)  # it warns when it is imported
    with pytest.warns(FutureWarning, match='has moved to smach_oracle.interfaces.interface_goal'):
        old = importlib.import_module('smach_oracle.expert.interface_goal')
    assert old.InterfaceGoal is interface_goal.InterfaceGoal
    assert old.SettlingServices is interface_goal.FinishServices


def test_the_services_that_end_a_goal_keep_their_old_name_with_a_warning():
    with pytest.warns(FutureWarning, match='SettlingServices is now called FinishServices'):
        old = interface_goal.SettlingServices
    assert old is interface_goal.FinishServices
    with pytest.raises(AttributeError, match='no_such_name'):
        interface_goal.__getattr__('no_such_name')
