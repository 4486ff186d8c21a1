"""The machines of the engine in use have every member that the executive relies on."""

import inspect
import os
import typing

import pytest

import smach
from smach_oracle.oracle.smach_private import Machine, StepLock

OURS_ALONE = {'_is_preempt_passed_on'}  # set, never read, on upstream's engine


def members_of(protocol):
    """The attributes, properties and methods that a protocol names."""
    prefix = protocol.__qualname__ + '.'
    methods = {
        name
        for name, value in vars(protocol).items()
        if isinstance(value, property)
        or inspect.isfunction(value)
        and value.__qualname__.startswith(prefix)
    }
    return methods | set(typing.get_type_hints(protocol))


def missing_in(thing, protocol):
    return {name for name in members_of(protocol) if not hasattr(thing, name)}


def test_a_machine_has_what_the_executive_uses():
    machine = smach.StateMachine(outcomes=['done'])
    assert len(members_of(Machine)) > 15
    assert missing_in(machine, Machine) <= OURS_ALONE


@pytest.mark.skipif(bool(os.environ.get('SMACH_UPSTREAM')), reason='it is about our engine')
def test_our_engine_has_the_members_that_upstream_lacks():
    assert not missing_in(smach.StateMachine(outcomes=['done']), Machine)


def test_the_lock_of_a_step_has_what_the_executive_uses():
    lock = smach.StateMachine(outcomes=['done'])._state_transitioning_lock
    assert members_of(StepLock) >= {'acquire', 'release', '__enter__', '__exit__'}
    assert not missing_in(lock, StepLock)


def test_a_member_that_is_missing_is_noticed():
    class More(Machine, typing.Protocol):
        _no_such_member: int

        def no_such_method(self):
            """Not there."""

    assert missing_in(smach.StateMachine(outcomes=['done']), More) >= {
        '_no_such_member',
        'no_such_method',
    }
