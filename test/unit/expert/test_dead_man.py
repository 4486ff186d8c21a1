"""A dead-man's handle: held by commands that keep coming, by one operator at a time."""
from smach_oracle.expert.dead_man import DeadMan


def test_it_is_held_as_long_as_commands_keep_coming():
    handle = DeadMan(0.1)
    assert handle.holder(0.0) == ''
    assert handle.press('ann', 1.0) == '' and handle.holder(1.09) == 'ann'
    handle.press('ann', 1.08)
    assert handle.holder(1.17) == 'ann' and handle.holder(1.181) == ''


def test_a_release_is_at_once_and_only_ones_own():
    handle = DeadMan(0.1)
    handle.press('ann', 1.0)
    handle.release('bob')
    assert handle.holder(1.01) == 'ann'
    handle.release('ann')
    assert handle.holder(1.01) == ''


def test_another_is_told_who_holds_it_and_may_take_it_afterwards():
    handle = DeadMan(0.1)
    handle.press('ann', 1.0)
    assert handle.press('bob', 1.05) == 'ann drives; one at a time' and handle.holder(1.05) == 'ann'
    assert handle.press('bob', 1.2) == '' and handle.holder(1.2) == 'bob'


def test_dropped_it_is_nobodys_even_without_a_watchdog():
    handle = DeadMan(float('inf'))
    handle.press('ann', 1.0)
    assert handle.holder(1e9) == 'ann'
    handle.drop()
    assert handle.holder(1.0) == ''
