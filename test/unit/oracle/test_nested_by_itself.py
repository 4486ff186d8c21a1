"""A nested machine that is executed by itself has a trial of its own."""

from contextlib import contextmanager

import pytest
from machines import Scripted

import smach
from smach_oracle.oracle import OperatorHand, OracleContainer, oracle_of

OUTCOMES = ['ok', 'aborted', 'preempted']


def around(state, label):
    machine = smach.StateMachine(OUTCOMES)
    with machine:
        machine.add(label, state)
    return machine


@pytest.fixture
def told():
    return []


@pytest.fixture
def trees(told):
    """A machine and the one nested in it, with a port that notes their trials."""

    @contextmanager
    def noted(machine):
        told.append(('begins', oracle_of(machine).path))
        yield
        told.append(('over', oracle_of(machine).path))

    state = Scripted('ok', outcomes=OUTCOMES)
    inner = around(state, 'STATE')
    outer = OracleContainer.wrap(around(inner, 'INNER'), name='OUTER')
    oracle_of(outer).around_nested_trial = noted
    outer.events.observers.append(lambda event: told.append(event.kind.name))
    return outer, inner, state


def test_its_port_is_around_its_events(trees, told):
    _, inner, _ = trees
    assert inner.execute() == 'ok'
    assert told[:2] == [('begins', 'OUTER/INNER'), 'TRIAL_START']
    assert told[-2:] == ['TRIAL_END', ('over', 'OUTER/INNER')]


def test_within_the_machine_around_it_the_port_is_not_asked(trees, told):
    outer, _, _ = trees
    assert outer.execute() == 'ok'
    assert all(isinstance(each, str) for each in told)


def test_a_port_that_raises_ends_it_before_it_begins(trees, told):
    outer, inner, state = trees

    def refuse(machine):
        raise OSError('no folder')

    oracle_of(outer).around_nested_trial = refuse
    with pytest.raises(OSError, match='no folder'):
        inner.execute()
    assert not told and not inner.is_running()


def test_an_operator_stops_it(trees):
    outer, _, state = trees
    hand, said = OperatorHand(outer), []

    def stopped(state, ud):
        said.extend([hand.status().running, hand.pause(), hand.preempt()])
        said.append(state.preempt_requested())
        state.service_preempt()
        return 'preempted'

    state.script[:] = [stopped]
    assert trees[1].execute() == 'preempted'
    assert said == [
        True,
        'OUTER is paused; runs to its end: STATE in OUTER/INNER',
        'OUTER/INNER is asked to stop',
        True,
    ]
    assert hand.preempt() == 'OUTER does not run'
