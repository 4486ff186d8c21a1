"""The engine in use has every private name that the executive relies on."""

import ast
import operator
import os
import pathlib
import typing

import pytest

import smach
from smach_oracle.oracle import smach_private

OURS_ALONE = {'_is_preempt_passed_on'}  # set, never read, on upstream's engine
THINGS = {  # by what the functions call it
    'machine': smach.StateMachine(outcomes=['done']),
    'container': smach.StateMachine(outcomes=['done']),
    'concurrence': smach.Concurrence(outcomes=['done'], default_outcome='done'),
    'iterator': smach.Iterator(['done'], [], [], [], 'item'),
    'state': smach.State(outcomes=['done']),
    'userdata': smach.UserData(),
}


def used(source):
    """Each private name in a source, with what it is an attribute of."""
    return {
        (each.value.id, each.attr)
        for each in ast.walk(ast.parse(source))
        if isinstance(each, ast.Attribute)
        and isinstance(each.value, ast.Name)
        and each.value.id in THINGS
        and each.attr.startswith('_')
    } - {('machine', '_oracle'), ('machine', '_state_ended')}  # of OracleContainer


def can_read(getter, thing):
    try:
        getter(thing)
    except AttributeError:
        return False
    return True


def unread():
    """Names of getters that can read no example of a type that they take, or say none."""
    getters = {
        name for name, each in vars(smach_private).items() if isinstance(each, operator.attrgetter)
    }
    kinds = smach_private.__annotations__
    found = getters.difference(kinds)
    for name, kind in kinds.items():
        (given,), _ = typing.get_args(kind)
        for each in typing.get_args(given) or (object if given is typing.Any else given,):
            examples = [thing for thing in THINGS.values() if isinstance(thing, each)]
            if not any(can_read(getattr(smach_private, name), thing) for thing in examples):
                found.add(name)
    return found


def missing(source):
    return {attr for thing, attr in used(source) if not hasattr(THINGS[thing], attr)}


SOURCE = pathlib.Path(smach_private.__file__).read_text(encoding='utf-8')


def test_the_engine_has_what_the_executive_uses():
    assert len(used(SOURCE)) > 10
    assert missing(SOURCE) <= OURS_ALONE
    assert unread() == set()


@pytest.mark.skipif(bool(os.environ.get('SMACH_UPSTREAM')), reason='it is about our engine')
def test_our_engine_has_the_names_that_upstream_lacks():
    assert not missing(SOURCE)


def test_the_lock_of_a_step_has_what_the_executive_uses():
    lock = smach_private.lock_of(THINGS['machine'])
    assert lock.acquire() and lock.release() is None


def test_a_name_that_is_missing_is_noticed(monkeypatch):
    assert missing('machine._no_such_member') == {'_no_such_member'}
    monkeypatch.setattr(smach_private, 'data_of', operator.attrgetter('_no_such_member'))
    assert unread() == {'data_of'}
