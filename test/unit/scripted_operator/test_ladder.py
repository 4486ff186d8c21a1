"""What the scripted operator tries next: a rung of a ladder, and nothing that was futile before, as
long as all that is seen is as it was.
"""

import pytest

from smach_oracle.scripted_operator.ladder import (
    AGAIN,
    BACK,
    BASE,
    BY_HAND,
    CLEAR,
    CLOSER,
    GIVE_UP,
    HIDDEN,
    LEAVE,
    LOST,
    MARK,
    UPRIGHT,
    WAIT,
    Asked,
    NextAct,
    Sight,
    TrialMemory,
    choose,
)
from smach_oracle.scripted_operator.state_plans import StatePlan

STATES = ['ARMS', 'DETECT', 'PICK', 'PLACE', 'HOME']
BOTH = ['perception', 'manipulation']
UNSEEN = Sight(seen=False, located=False)
PLANS = {
    'DETECT': StatePlan('show', hidden='ARMS', otherwise='ARMS'),
    'PICK': StatePlan('take', otherwise='DETECT'),
    'PLACE': StatePlan('put_down', place='p', lost='DETECT', otherwise='PICK'),
    'DOOR': StatePlan('retry', otherwise='DETECT', base=(-0.1, 0.0, 0.0), leave='HOME', tries=1),
}


def course(state, sight, rounds, interfaces=BOTH, states=STATES, worked=False):
    """What is done about a state that fails again and again, as (act, state or interface)."""
    memory, acts = TrialMemory(), []
    for _ in range(rounds):
        choice = choose(PLANS[state], Asked(state, states + ['DOOR'], interfaces), sight, memory)
        acts.append((choice.act, choice.interface or choice.goto))
        memory.note(state, choice, sight, worked)
    return acts


def test_a_person_whom_the_light_dazzles_drives_the_base_and_has_the_head_turned_again():
    plan = PLANS['DETECT']._replace(base=(0.0, 0.3, 0.0), again='HEAD')
    asked = Asked('DETECT', STATES + ['HEAD', 'DETECT'], BOTH)
    memory = TrialMemory()
    choice = choose(plan, asked, UNSEEN._replace(dazzled=True), memory)
    assert (choice.act, choice.goto, choice.base) == (BASE, 'HEAD', plan.base)
    memory.note('DETECT', choice, UNSEEN._replace(dazzled=True))
    assert choose(plan, asked, UNSEEN._replace(dazzled=True), memory).act == HIDDEN
    assert choose(plan, asked, UNSEEN, TrialMemory()).act == HIDDEN


SIGHTS = [
    ('DETECT', Sight()),
    ('DETECT', UNSEEN),
    ('DETECT', UNSEEN._replace(dazzled=True)),
    ('DETECT', UNSEEN._replace(open=True)),
    ('PICK', Sight()),
    ('PICK', Sight(crowded=True)),
    ('PICK', UNSEEN),
    ('PLACE', Sight(holds=True)),
    ('PLACE', Sight(holds=True, blocked=True)),
    ('PLACE', UNSEEN),
    ('DOOR', Sight()),
]


@pytest.mark.parametrize('state, sight', SIGHTS)
def test_nothing_is_answered_twice_while_all_is_seen_to_be_as_it_was(state, sight):
    memory, choices = TrialMemory(), []
    for _ in range(20):
        choices.append(choose(PLANS[state], Asked(state, STATES + ['DOOR'], BOTH), sight, memory))
        if choices[-1].act in (GIVE_UP, LEAVE):
            break
        memory.note(state, choices[-1], sight)
    assert choices[-1].act in (GIVE_UP, LEAVE)
    answers = [(each.interface and each.act, each.goto, each.wait_s, each.base) for each in choices]
    assert len(set(answers)) == len(answers)
    assert len(choices) <= 7


@pytest.mark.parametrize('state', ['DETECT', 'PICK', 'PLACE'])
def test_what_fell_to_the_floor_is_given_up_at_once(state):
    acts = course(state, Sight(lies=True, lost=True, reachable=False), 1)
    assert acts == [(GIVE_UP, '')]


def test_what_is_in_the_hand_is_not_given_up_for_what_lies_on_the_floor():
    assert course('PLACE', Sight(holds=True, lost=True), 1)[0][0] == BY_HAND


def test_what_is_seen_nowhere_costs_few_questions():
    """Things stand there in good light, and it is not among them: nothing hides it."""
    acts = course('DETECT', UNSEEN._replace(open=True), 3)
    assert [act for act, _ in acts] == [BACK, GIVE_UP, GIVE_UP]
    acts = course('DETECT', UNSEEN, 4)
    assert [act for act, _ in acts] == [HIDDEN, GIVE_UP, GIVE_UP, GIVE_UP]


def test_a_person_waits_once_where_the_light_may_pass_and_not_elsewhere():
    for light in ('dazzled', 'dim'):
        acts = [act for act, _ in course('PICK', UNSEEN._replace(**{light: True}), 9)]
        assert acts.count(WAIT) == 1
    assert WAIT not in [act for act, _ in course('PICK', UNSEEN, 9)]


def test_what_lies_is_set_upright_on_a_table_and_at_its_place():
    assert course('PICK', Sight(lies=True), 2, worked=True) == [
        (UPRIGHT, 'manipulation'),
        (BACK, 'DETECT'),
    ]
    assert course('PICK', Sight(lies=True, moved=True), 1) == [(UPRIGHT, 'manipulation')]
    assert course('DETECT', Sight(lies=True), 1) == [(UPRIGHT, 'manipulation')]
    assert course('PLACE', Sight(lies=True), 1) == [(BY_HAND, 'manipulation')]
    shelf = PLANS['PICK']._replace(inside=True)
    choice = choose(shelf, Asked('PICK', STATES, BOTH), Sight(lies=True, shelf=True), TrialMemory())
    assert choice.act == BY_HAND, 'nothing is set upright on a shelf'


def test_what_could_not_be_set_upright_is_given_up_whatever_state_is_asked_about():
    """The robot would put it down lying."""
    memory = TrialMemory()
    choice = choose(PLANS['PICK'], Asked('PICK', STATES, BOTH), Sight(lies=True), memory)
    memory.note('PICK', choice, Sight(lies=True))
    for state in ('PICK', 'DETECT'):
        after = choose(PLANS[state], Asked(state, STATES, BOTH), Sight(lies=True), memory)
        assert after.act == GIVE_UP
    elsewhere = Sight(lies=True, place=(0.6, 0.1, 0.8))
    assert choose(PLANS['DETECT'], Asked('DETECT', STATES, BOTH), elsewhere, memory).act == UPRIGHT


@pytest.mark.parametrize(
    'change, again',
    [
        ({}, False),
        ({'place': (0.63, 0.01, 0.8)}, False),
        ({'place': (0.66, 0.0, 0.8)}, True),
        ({'dim': True}, True),
        ({'around': ()}, True),
        ({'around': ((0.71, 0.09, 0.8),)}, False),
        ({'around': ((0.7, 0.2, 0.8),)}, True),
        ({'place': None}, True),
        ({'holds': True}, True),
    ],
)
def test_a_thing_that_the_eye_puts_a_little_elsewhere_has_not_moved(change, again):
    before = Sight(place=(0.61, 0.0, 0.8), around=((0.7, 0.1, 0.8),))
    memory, asked = TrialMemory(), Asked('PICK', STATES, BOTH)
    first = choose(PLANS['PICK'], asked, before, memory)
    memory.note('PICK', first, before)
    assert memory.was_futile('PICK', first, before._replace(**change)) != again


def test_what_came_about_is_done_again_where_it_is_needed_again():
    memory = TrialMemory()
    mark = NextAct(MARK, interface='perception')
    memory.note('DETECT', mark, Sight(), worked=True)
    assert choose(PLANS['DETECT'], Asked('DETECT', STATES, BOTH), Sight(), memory).act == MARK


def test_what_is_seen_is_shown_and_what_is_not_seen_is_looked_for_elsewhere():
    assert course('DETECT', Sight(), 1) == [(MARK, 'perception')]
    assert course('DETECT', UNSEEN, 1) == [(HIDDEN, 'ARMS')]
    seen_without_depth = Sight(located=False, dazzled=True)
    assert [act for act, _ in course('DETECT', seen_without_depth, 3)] == [MARK, WAIT, BACK]


def test_a_limb_that_is_in_the_way_is_sent_aside_first_but_once_alone():
    assert course('DETECT', Sight(covered=True), 2) == [(HIDDEN, 'ARMS'), (MARK, 'perception')]


def test_what_stands_too_close_is_moved_aside_and_then_the_machine_goes_back():
    acts = course('PICK', Sight(crowded=True), 3, worked=True)
    assert acts == [(BY_HAND, 'manipulation'), (CLEAR, 'manipulation'), (BACK, 'DETECT')]
    assert [act for act, _ in course('DETECT', Sight(crowded=True), 2)] == [MARK, CLEAR]
    assert course('PLACE', Sight(holds=True, blocked=True), 1) == [(CLEAR, 'manipulation')]


def test_where_it_could_not_be_moved_something_else_is_done():
    acts = [act for act, _ in course('PICK', Sight(crowded=True), 4)]
    assert acts[1] == CLEAR and CLEAR not in acts[2:]


def test_what_stands_elsewhere_than_detected_is_detected_anew_before_it_is_taken():
    acts = course('PICK', Sight(moved=True), 2)
    assert acts == [(BACK, 'DETECT'), (BY_HAND, 'manipulation')]
    assert course('PICK', Sight(moved=True, holds=True), 1) == [(BY_HAND, 'manipulation')]


def test_what_is_out_of_reach_is_put_nearer_and_nobody_grasps_for_it_first():
    acts = course('PICK', Sight(reachable=False), 2, worked=True)
    assert acts == [(CLOSER, 'manipulation'), (BACK, 'DETECT')]


def test_what_is_in_the_hand_is_put_down_and_an_empty_hand_puts_nothing_down():
    assert course('PLACE', Sight(holds=True), 1) == [(BY_HAND, 'manipulation')]
    assert course('PLACE', Sight(), 1) == [(LOST, 'DETECT')]


def test_at_a_door_it_is_tried_again_from_further_back_from_another_place():
    acts = course('DOOR', Sight(), 4)
    assert acts == [(AGAIN, 'DOOR'), (BACK, 'DETECT'), (BASE, 'DOOR'), (LEAVE, 'HOME')]
    memory = TrialMemory()
    for act in (NextAct(AGAIN, goto='DOOR'), NextAct(BACK, goto='DETECT')):
        memory.note('DOOR', act, Sight())
    driven = choose(PLANS['DOOR'], Asked('DOOR', ['DOOR'], BOTH), Sight(), memory)
    assert driven.base == (-0.1, 0.0, 0.0)


def test_what_the_robot_has_repeated_in_vain_is_not_repeated_by_a_person_who_has_other_means():
    acts = [act for act, _ in course('DOOR', Sight(repeated=True), 3)]
    assert acts == [BACK, BASE, LEAVE]
    plain, asked = StatePlan('retry'), Asked('DOOR', ['DOOR'], BOTH)
    assert choose(plain, asked, Sight(repeated=True), TrialMemory()).act == AGAIN


def test_without_an_interface_or_a_state_to_go_to_the_rest_is_tried():
    acts = course('PICK', Sight(), 12, interfaces=[])
    assert not {act for act, _ in acts} & {BY_HAND, CLEAR, CLOSER} and acts[0] == (BACK, 'DETECT')
    assert course('DETECT', UNSEEN, 1, states=[], interfaces=[])[0][0] == GIVE_UP


def test_each_state_and_each_trial_has_a_memory_of_its_own():
    memory = TrialMemory()
    memory.note('PICK', NextAct(BY_HAND, interface='manipulation'), Sight())
    assert (
        choose(PLANS['PLACE'], Asked('PLACE', STATES, BOTH), Sight(holds=True), memory).act
        == BY_HAND
    )
    assert (memory.times('PICK', BY_HAND), memory.times('PLACE', BY_HAND)) == (1, 0)
