"""Containers that lie in each other: as many as the stack holds, and one clear error beyond."""

import inspect
import os
import re
import sys
import threading

import pytest
from machines import FakeExpert, Scripted, chain_of

import smach
from smach_oracle.oracle import OracleContainer, oracle_of
from smach_oracle.oracle.errors import TooDeepError
from smach_oracle.oracle.records.events import EventKind

UPSTREAM = bool(os.environ.get('SMACH_UPSTREAM'))
OUTCOMES = ['ok', 'aborted']


def machine_around(state):
    machine = smach.StateMachine(OUTCOMES)
    with machine:
        machine.add('S', state)
    return machine


def iterator_around(state):
    iterator = smach.Iterator(list(OUTCOMES), [], [], [1], 'item', 'ok')
    with iterator:
        iterator.set_contained_state('S', state, loop_outcomes=['ok'])
    return iterator


def concurrence_around(state):
    concurrence = smach.Concurrence(OUTCOMES, 'aborted', outcome_map={'ok': {'S': 'ok'}})
    with concurrence:
        concurrence.add('S', state)
    return concurrence


def nested(around, count, state=None):
    inner = Scripted(outcomes=OUTCOMES) if state is None else state
    for _ in range(count):
        inner = around(inner)
    return machine_around(inner)


def executed(machine):
    """The outcome, or the error, of a machine that has a stack of its own."""
    ended = []

    def execute():
        try:
            ended.append(machine.execute())
        except Exception as err:
            ended.append(err)

    thread = threading.Thread(target=execute, daemon=True)
    thread.start()
    thread.join(120.0)
    assert ended, 'the machine still runs'
    return ended[0]


def watched(machine, expert=None):
    OracleContainer.wrap(machine, expert=expert, name='TOP')
    seen = []
    oracle_of(machine).events.observers.append(seen.append)
    return seen


@pytest.fixture(autouse=True)
def usual_limit():
    before = sys.getrecursionlimit()
    sys.setrecursionlimit(1000)
    yield
    sys.setrecursionlimit(before)


@pytest.mark.parametrize('around', [machine_around, iterator_around, concurrence_around])
def test_150_containers_in_each_other_run_under_an_oracle(around):
    machine = nested(around, 150)
    watched(machine)
    assert executed(machine) == 'ok'


@pytest.mark.parametrize('around, count', [(machine_around, 280), (iterator_around, 550)])
def test_a_tree_that_is_too_deep_ends_with_one_error_that_says_what_to_do(around, count):
    machine, expert = nested(around, count), FakeExpert()
    seen = watched(machine, expert)
    error = executed(machine)
    assert isinstance(error, TooDeepError)
    assert str(error).startswith('TOP: {} containers lie in each other'.format(count + 1))
    assert len(str(error)) < 300
    assert [event.kind for event in seen].count(EventKind.FAILURE) == 0
    assert expert.questions == []
    assert str(error) in seen[-1].text
    sys.setrecursionlimit(int(re.search(r'setrecursionlimit\((\d+)\)', str(error)).group(1)))
    assert executed(machine) == 'ok'  # the same machine


def test_a_machine_in_a_concurrence_is_too_deep_likewise():
    machine, expert = machine_around(concurrence_around(nested(machine_around, 280))), FakeExpert()
    seen = watched(machine, expert)
    error = executed(machine)
    # upstream's Concurrence says only that one of its states has raised an error
    assert isinstance(error, smach.InvalidUserCodeError if UPSTREAM else TooDeepError)
    assert expert.questions == []
    assert not [event for event in seen if event.kind is EventKind.DECISION]


def test_a_state_whose_functions_call_each_other_without_end_has_failed_as_by_any_error():
    def endless(state, userdata):
        return endless(state, userdata)

    machine = chain_of(Scripted(endless, 'ok'))
    seen = watched(machine)
    assert executed(machine) == 'done'
    (failed,) = [event for event in seen if event.kind is EventKind.FAILURE]
    assert 'RecursionError' in failed.text


def test_another_error_where_little_of_the_stack_is_left_is_a_failure():
    def slips(state, userdata):
        sys.setrecursionlimit(len(inspect.stack(0)) + 140)
        raise ValueError('slipped')

    def goes_on(state, userdata):
        sys.setrecursionlimit(1000)
        return 'ok'

    machine = chain_of(Scripted(slips, goes_on))
    seen = watched(machine)
    assert executed(machine) == 'done'
    (failed,) = [event for event in seen if event.kind is EventKind.FAILURE]
    assert 'slipped' in failed.text


def test_errors_that_name_each_other_as_their_cause_are_looked_at_once():
    first, second = ValueError('first'), ValueError('second')
    first.__cause__, second.__cause__ = second, first
    machine = machine_around(machine_around(Scripted(first, outcomes=OUTCOMES)))
    watched(machine)
    assert executed(machine) == 'ok'
