"""What the scripted operator tries next: a rung of a ladder, and never what has just failed."""
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
    WAIT,
    Asked,
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
    'DOOR': StatePlan('retry', otherwise='DETECT', base=(-0.1, 0.0, 0.0), leave='HOME', tries=1)
}


def course(state, sight, rounds, interfaces=BOTH, states=STATES, worked=False):
    """What is done about a state that fails again and again, as (act, state or interface)."""
    memory, acts = TrialMemory(), []
    for _ in range(rounds):
        choice = choose(PLANS[state], Asked(state, states + ['DOOR'], interfaces), sight, memory)
        acts.append((choice.act, choice.interface or choice.goto))
        memory.note(state, choice.act, worked)
    return acts


def test_a_person_whom_the_light_dazzles_drives_the_base_and_has_the_head_turned_again():
    plan = PLANS['DETECT']._replace(base=(0.0, 0.3, 0.0), again='HEAD')
    asked = Asked('DETECT', STATES + ['HEAD', 'DETECT'], BOTH)
    memory = TrialMemory()
    choice = choose(plan, asked, UNSEEN._replace(dazzled=True), memory)
    assert (choice.act, choice.goto, choice.base) == (BASE, 'HEAD', plan.base)
    memory.note('DETECT', BASE)
    assert choose(plan, asked, UNSEEN._replace(dazzled=True), memory).act == HIDDEN
    assert choose(plan, asked, UNSEEN, TrialMemory()).act == HIDDEN


@pytest.mark.parametrize('state, sight', [
    ('DETECT', Sight()), ('DETECT', UNSEEN), ('PICK', Sight()), ('PICK', UNSEEN),
    ('PLACE', Sight(holds=True)), ('PLACE', Sight(holds=True, blocked=True)), ('DOOR', Sight())])
def test_what_has_just_failed_is_not_repeated_and_in_the_end_a_person_gives_up(state, sight):
    acts = [act for act, _ in course(state, sight, 30)]
    end = min(acts.index(last) for last in (GIVE_UP, LEAVE) if last in acts)
    assert 3 <= end <= 14
    kinds = acts[:end]
    assert sum(one == other for one, other in zip(kinds, kinds[1:])) <= 1, kinds
    assert len(set(kinds)) >= 3


def test_what_is_seen_is_shown_and_what_is_not_seen_is_looked_for_elsewhere():
    assert course('DETECT', Sight(), 1) == [(MARK, 'perception')]
    assert course('DETECT', UNSEEN, 1) == [(HIDDEN, 'ARMS')]
    seen_without_depth = Sight(located=False)
    assert [act for act, _ in course('DETECT', seen_without_depth, 3)] == [MARK, WAIT, MARK]


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


def test_at_a_door_it_is_tried_again_from_further_back_from_another_place_and_later():
    acts = course('DOOR', Sight(), 6)
    assert acts == [(AGAIN, 'DOOR'), (BACK, 'DETECT'), (BASE, 'DOOR'), (WAIT, 'DOOR'),
                    (BACK, 'DETECT'), (LEAVE, 'HOME')]
    memory = TrialMemory()
    for act in (AGAIN, BACK):
        memory.note('DOOR', act)
    driven = choose(PLANS['DOOR'], Asked('DOOR', ['DOOR'], BOTH), Sight(), memory)
    assert driven.base == (-0.1, 0.0, 0.0)


def test_without_an_interface_or_a_state_to_go_to_the_rest_is_tried():
    acts = course('PICK', Sight(), 12, interfaces=[])
    assert not {act for act, _ in acts} & {BY_HAND, CLEAR, CLOSER} and acts[0] == (BACK, 'DETECT')
    assert course('DETECT', UNSEEN, 1, states=[], interfaces=[])[0][0] == GIVE_UP


def test_each_state_and_each_trial_has_a_memory_of_its_own():
    memory = TrialMemory()
    memory.note('PICK', BY_HAND)
    assert choose(PLANS['PLACE'], Asked('PLACE', STATES, BOTH), Sight(holds=True),
                  memory).act == BY_HAND
    assert (memory.times('PICK', BY_HAND), memory.times('PLACE', BY_HAND)) == (1, 0)
