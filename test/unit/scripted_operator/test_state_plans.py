"""What the scripted operator answers, from its settings and the situation."""
import pytest

from smach_oracle.oracle.errors import SettingsError
from smach_oracle.scripted_operator.state_plans import (
    OperatorAnswer,
    QuestionFacts,
    StatePlan,
    StatePlans,
    choose_answer,
    missing,
)

BOTH = ['perception', 'manipulation']
STATES = ['MOVE_ARMS_ASIDE', 'DETECT', 'PICK', 'PLACE']


def situation(state, tried=0, interfaces=BOTH, holds=True, seen=True, states=STATES):
    return QuestionFacts(state, states, interfaces, tried, holds, seen)


def test_a_state_gets_its_own_means_and_others_the_default():
    plans = StatePlans({
        'PICK': {'means': 'take', 'arm': 'left', 'what': 'objects'}, 'default': {'means': 'retry'}
    })
    assert plans.of('PICK') == StatePlan('take', 'left', 'objects')
    assert plans.of('DRIVE').means == 'retry' and StatePlans({}).of('DRIVE').means == 'retry'


@pytest.mark.parametrize('means, interface', [('show', 'perception'), ('take', 'manipulation'),
                                              ('put_down', 'manipulation')])
def test_what_a_person_can_do_is_done_with_an_interface(means, interface):
    assert choose_answer(StatePlan(means), situation('PICK')) == OperatorAnswer(interface=interface)


def test_after_some_tries_it_goes_back_and_then_tries_again():
    plan = StatePlan('take', otherwise='DETECT', tries=2)
    answers = [choose_answer(plan, situation('PICK', tried)) for tried in range(4)]
    assert [(answer.interface, answer.goto) for answer in answers] == [
        ('manipulation', ''), ('manipulation', ''), ('', 'DETECT'), ('manipulation', '')]


def test_without_the_interface_the_state_is_tried_again_and_then_an_earlier_one():
    plan = StatePlan('retry', otherwise='DETECT', tries=1)
    assert [choose_answer(plan, situation('PICK', tried, [])).goto for tried in range(4)] == [
        'PICK', 'DETECT', 'PICK', 'DETECT']


def test_what_is_not_worth_more_tries_is_left_undone():
    plan = StatePlan('retry', otherwise='DETECT', leave='PLACE', tries=1)
    assert [choose_answer(plan, situation('PICK', tried)).goto for tried in range(6)] == [
        'PICK', 'DETECT', 'PICK', 'DETECT', 'PLACE', 'PLACE']
    plan = StatePlan('take', otherwise='DETECT', leave='PLACE', tries=2)
    assert [choose_answer(plan, situation('PICK', tried)).goto
            for tried in (5, 6)] == ['DETECT', 'PLACE']


@pytest.mark.parametrize('means, offered, lacking',
                         [('take', ['hand', 'perception'], 'manipulation'),
                          ('show', [], 'perception'), ('put_down', BOTH, ''), ('retry', [], '')])
def test_an_interface_is_known_by_the_name_under_which_it_is_offered(means, offered, lacking):
    assert missing(StatePlan(means), offered) == lacking


def test_what_cannot_be_seen_is_not_shown_and_what_is_not_held_is_not_put_down():
    assert choose_answer(StatePlan('show', hidden='MOVE_ARMS_ASIDE'),
                         situation('DETECT', seen=False)).goto == 'MOVE_ARMS_ASIDE'
    assert choose_answer(StatePlan('put_down', place='p', lost='DETECT'),
                         situation('PLACE', holds=False)).goto == 'DETECT'


def test_a_state_that_cannot_be_entered_is_not_chosen_and_with_none_left_it_gives_up():
    plan = StatePlan('show', hidden='MOVE_ARMS_ASIDE')
    assert choose_answer(plan, situation('DETECT', seen=False, states=['DETECT'])).goto == 'DETECT'
    gave_up = choose_answer(plan, situation('DETECT', seen=False, states=[]))
    assert (gave_up.interface, gave_up.goto) == ('', '')


@pytest.mark.parametrize('settings, says', [
    (7, 'states'), ({'PICK': 'take'}, 'PICK'), ({'PICK': {'means': 'dance'}}, 'PICK.means'),
    ({'PICK': {'means': ['take']}}, 'PICK.means'), ({'PICK': {'means': {'take': 1}}}, 'PICK.means'),
    ({'PICK': {'means': 'take', 'arms': 'left'}}, 'PICK.arms'),
    ({'PICK': {'means': 'take', 'arm': 'third'}}, 'PICK.arm'),
    ({'PLACE': {'means': 'put_down'}}, 'either place or onto'),
    ({'PICK': {'means': 'take', 'tries': 0}}, 'PICK.tries'),
    ({'PICK': {'means': 'take', 'inside': 'yes'}}, 'PICK.inside'),
    ({'PICK': {'means': 'take', 'what': 3}}, 'PICK.what')])
def test_settings_that_cannot_be_are_refused_by_name(settings, says):
    with pytest.raises(SettingsError, match=says):
        StatePlans(settings)
