"""The log says what a precondition raised, since that may be a mistake in a program."""

import pytest
from machines import Scripted
from test_preconditions import ends, machine_with


def warned(log):
    return [text for level, text in log if level == 'warn' and 'precondition' in text]


def nothing_given():  # a mistake: it gets the userdata
    return True


@pytest.mark.parametrize('is_check', [False, True])
def test_the_log_says_what_a_function_raised(log, is_check):
    spec = (nothing_given, Scripted()) if is_check else nothing_given
    machine = machine_with(spec)
    assert machine.run() == 'done'
    assert [outcome for _, outcome in ends(machine)] == ['met' if is_check else 'not met']
    (told,) = warned(log)
    assert told.startswith(
        "SM_ROOT/B: precondition nothing_given raised TypeError('nothing_given()"
    )
    assert told.endswith(': it is not met')


def test_the_log_says_what_a_state_raised(log):
    assert machine_with(Scripted(ValueError('no camera'))).run() == 'done'
    assert warned(log) == [
        "SM_ROOT/B: precondition Scripted raised ValueError('no camera'): it is not met"
    ]


def test_the_log_says_nothing_of_one_that_does_not_hold(log):
    assert machine_with(lambda ud: False).run() == 'done'
    assert not warned(log)
