"""A dead-man's handle: held by commands that keep coming, by one operator at a time."""

from smach_oracle.interfaces.manipulation.dead_man_switch import DeadManSwitch


def test_it_is_held_as_long_as_commands_keep_coming():
    handle = DeadManSwitch(0.1)
    assert handle.holder(0.0) == ''
    assert handle.press('ann', 1.0) == '' and handle.holder(1.09) == 'ann'
    handle.press('ann', 1.08)
    assert handle.holder(1.17) == 'ann' and handle.holder(1.181) == ''


def test_a_release_is_at_once_and_only_ones_own():
    handle = DeadManSwitch(0.1)
    handle.press('ann', 1.0)
    handle.release('bob')
    assert handle.holder(1.01) == 'ann'
    handle.release('ann')
    assert handle.holder(1.01) == ''


def test_another_is_told_who_holds_it_and_may_take_it_afterwards():
    handle = DeadManSwitch(0.1)
    handle.press('ann', 1.0)
    assert handle.press('bob', 1.05) == 'ann drives; one at a time' and handle.holder(1.05) == 'ann'
    assert handle.press('bob', 1.2) == '' and handle.holder(1.2) == 'bob'


def test_dropped_it_is_nobodys_even_without_a_watchdog():
    handle = DeadManSwitch(float('inf'))
    handle.press('ann', 1.0)
    assert handle.holder(1e9) == 'ann'
    handle.drop(2.0)
    assert handle.holder(1.0) == ''


def test_a_command_that_has_waited_holds_nothing():
    handle = DeadManSwitch(0.1)
    handle.press('ann', 1.0)
    assert handle.holder(1.5) == ''


def test_a_hand_that_pressed_when_it_was_dropped_must_let_go_first():
    handle = DeadManSwitch(0.1)
    handle.press('ann', 1.0)
    handle.drop(1.05)
    assert 'let go' in handle.press('ann', 1.2) and 'let go' in handle.press('ann', 1.45), (
        'pressed all along'
    )
    assert handle.press('bob', 1.46) == '', 'another one may'
    handle.release('bob')
    handle.release('ann')
    assert handle.press('ann', 1.5) == '' and handle.holder(1.5) == 'ann'
    handle.drop(1.55)
    assert handle.press('ann', 1.9) == '', 'silence is letting go, too'
    handle.refuse('ann')
    assert handle.holder(1.9) == '' and handle.press('ann', 1.91) == '', (
        'refused for another reason'
    )
    handle.drop(5.0)
    assert handle.press('ann', 5.01) == '', 'nobody pressed it'


def test_who_presses_before_there_is_anything_to_hold_it_for_does_not_hold_what_begins():
    handle = DeadManSwitch(0.1)
    handle.press_for_nothing('ann', 1.0)
    assert 'let go' in handle.press('ann', 1.1)
    handle.refuse('ann')
    assert 'let go' in handle.press('ann', 1.2), 'a refused press is no letting go'
    handle.release('ann')
    assert handle.press('ann', 1.3) == ''
    in_steps = DeadManSwitch(float('inf'))
    in_steps.press_for_nothing('ann', 1.0)
    assert in_steps.press('ann', 1.1) == '', 'where silence says nothing'


def test_without_a_watchdog_it_is_a_lease_that_commands_renew():
    handle = DeadManSwitch(float('inf'), lease_s=3.0)
    handle.press('ann', 1.0)
    handle.press('ann', 3.0)
    assert handle.press('bob', 5.9) == 'ann drives; one at a time' and not handle.lapsed(5.9)
    assert handle.lapsed(6.0) and handle.holder(100.0) == 'ann', (
        'she was slow, and nobody has relieved her'
    )
    assert handle.press('ann', 100.0) == '' and 'ann drives' in handle.press('bob', 101.0)
    assert handle.press('bob', 103.1) == '' and handle.holder(103.1) == 'bob'
    assert handle.press('ann', 104.0) == 'bob drives; one at a time'


def test_dropped_by_somebody_else_it_must_be_let_go_before_it_is_held_again():
    handle = DeadManSwitch(0.1)
    handle.press('ann', 1.0)
    handle.drop(1.05)
    assert 'somebody has stopped the hand' in handle.press('ann', 1.08)
    handle.release('ann')
    assert handle.press('ann', 1.1) == '' and handle.holder(1.11) == 'ann'
