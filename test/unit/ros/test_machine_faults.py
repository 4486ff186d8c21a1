"""A machine that SMACH refuses to run is found before it runs, with state, outcome and name."""

import os
import re

import pytest

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.ros.oracle_run.machine_faults import (
    MachineFaultError,
    faults_of,
    refused_while_built,
)

ENDS = ['done', 'failed']


def state(*outcomes):
    return smach.State(outcomes=list(outcomes))


def machine(**states):
    """A StateMachine of states, each with its transitions."""
    sm = smach.StateMachine(outcomes=list(ENDS))
    with sm:
        for label, (given, transitions) in states.items():
            smach.StateMachine.add(label, given, transitions)
    return sm


def around(inner):
    return machine(INNER=(inner, dict.fromkeys(inner.get_registered_outcomes(), 'done')))


def concurrence(outcome_map, **states):
    both = smach.Concurrence(list(ENDS), 'failed', outcome_map={})
    with both:
        for label, given in states.items():
            smach.Concurrence.add(label, given)
    both._outcome_map = outcome_map
    return both


def iterator(given=None, **contained):
    each = smach.Iterator(list(ENDS), [], [], it=[1], it_label='i', exhausted_outcome='done')
    if given is not None:
        with each:
            smach.Iterator.set_contained_state('EACH', given, **contained)
    return each


def sequence(*labels):
    row = smach.Sequence(outcomes=list(ENDS), connector_outcome='ok')
    with row:
        for label in labels:
            smach.Sequence.add(label, state('ok', 'bad'))
    return row


def begun_at(label):
    sm = machine(A=(state('ok'), {'ok': 'done'}))
    sm.set_initial_state([label])
    return sm


REFUSED = {
    "TOP/A: its outcome 'ok' leads to 'BB', which is no state or outcome of TOP (did you mean "
    'B?)': lambda: machine(A=(state('ok'), {'ok': 'BB'}), B=(state('ok'), {'ok': 'done'})),
    "TOP/A: its outcome 'odd' leads to no state, and is no outcome of TOP": lambda: machine(
        A=(state('ok', 'odd'), {'ok': 'done'})
    ),
    'TOP: it has no states': machine,
    'TOP: its initial state is LOST, which is none of its states; they are A': lambda: begun_at(
        'LOST'
    ),
    "TOP/A: its outcome 'bad' leads to no state": lambda: sequence('A', 'B'),
    "TOP: its outcome map waits for the state 'LEFF', which is none of its states (did you mean "
    'LEFT?)': lambda: concurrence({'done': {'LEFF': 'ok'}}, LEFT=state('ok')),
    "TOP: its outcome map leads to 'dome', which is none of its outcomes (did you mean "
    'done?)': lambda: concurrence({'dome': {'LEFT': 'ok'}}, LEFT=state('ok')),
}
EMPTY = {'a Concurrence': lambda: concurrence({}), 'an Iterator': iterator, 'a Sequence': sequence}


@pytest.mark.parametrize('text', list(REFUSED))
def test_what_smach_refuses_is_named(text):
    faults = faults_of(REFUSED[text](), 'TOP')
    assert any(str(fault).startswith(text) for fault in faults), faults
    assert all(fault.is_certain for fault in faults)


@pytest.mark.parametrize('kind', list(EMPTY))
def test_containers_without_states_are_named(kind):
    assert [str(each) for each in faults_of(EMPTY[kind](), 'TOP')] == ['TOP: it has no states']


@pytest.mark.parametrize(
    'make',
    [
        lambda inner: around(around(inner)),
        lambda inner: around(concurrence({}, LEFT=inner)),
        lambda inner: around(iterator(inner, loop_outcomes=['done'])),
    ],
)
def test_faults_are_found_at_any_depth(make):
    top = make(machine(A=(state('ok'), {'ok': 'BB'})))
    found = [str(fault) for fault in faults_of(top, 'TOP') if fault.is_certain]
    assert len(found) == 1 and "/A: its outcome 'ok' leads to 'BB'" in found[0]
    assert found[0].startswith('TOP/INNER/')


def test_a_wrapped_machine_has_the_faults_of_a_bare_one_and_no_others():
    top = around(concurrence({'done': {'LEFT': 'ok'}}, LEFT=state('ok')))
    assert not faults_of(OracleContainer.wrap(top), 'TOP')


def test_an_outcome_that_is_registered_late_is_no_certain_fault():
    given = state('ok')
    sm = machine(A=(given, {'ok': 'done'}))
    given.register_outcomes(['later'])
    (fault,) = faults_of(sm, 'TOP')
    assert not fault.is_certain and "'later' was registered after it was added" in str(fault)


def test_an_iterator_may_end_in_an_outcome_that_it_lacks():
    (fault,) = faults_of(iterator(state('ok', 'broken'), loop_outcomes=['ok']), 'TOP')
    assert not fault.is_certain and "would end in 'broken'" in str(fault)


class Shown(smach.StateMachine):
    def get_children(self):
        return dict(super().get_children(), LEGEND=state('ok'))


class Completed(smach.StateMachine):
    def execute(self, parent_ud=None):
        with self:
            smach.StateMachine.add('B', state('ok'), {'ok': 'done'})
        return super().execute(parent_ud)


def with_one_state(kind, target):
    sm = kind(outcomes=list(ENDS))
    with sm:
        smach.StateMachine.add('A', state('ok'), {'ok': target})
    return sm


RUN_BY_SMACH = {
    'an empty machine, which a state fills': lambda: around(machine()),
    'an empty Concurrence, which a state fills': lambda: around(concurrence({})),
    'an own execute, which adds the target': lambda: with_one_state(Completed, 'B'),
    'a map with an outcome that a state lacks': lambda: concurrence(
        {'done': {'LEFT': 'okay'}}, LEFT=state('ok')
    ),
    'a map with an end that is not reached': lambda: iterator(
        state('ok'), loop_outcomes=['ok'], final_outcome_map={'done': 'dome'}
    ),
    'a state that is only shown': lambda: with_one_state(Shown, 'done'),
}


@pytest.mark.parametrize('what', list(RUN_BY_SMACH))
def test_what_smach_may_run_is_no_certain_fault(what):
    assert not [fault for fault in faults_of(RUN_BY_SMACH[what](), 'TOP') if fault.is_certain]


def test_a_machine_that_builds_itself_when_it_is_executed_is_no_fault():
    class Late(smach.StateMachine):
        def execute(self, parent_ud=None):
            with self:
                smach.StateMachine.add('A', state('ok'), {'ok': 'done'})
            return super().execute(parent_ud)

    assert not [fault for fault in faults_of(Late(outcomes=['done']), 'TOP') if fault.is_certain]


def test_the_complaints_of_an_authors_own_check_are_passed_on():
    class Picky(smach.StateMachine):
        def check_consistency(self):
            raise smach.InvalidStateError('no gripper')

    sm = Picky(outcomes=['done'])
    with sm:
        smach.StateMachine.add('A', state('ok'), {'ok': 'done'})
    assert [str(each) for each in faults_of(sm, 'TOP')] == [
        'TOP: SMACH refuses it: InvalidStateError: no gripper'
    ]


class Outcomes(smach.State):
    def get_registered_outcomes(self):
        raise KeyError('gripper')


def added_late(state):
    sm = machine(A=(smach.State(outcomes=['ok']), {'ok': 'done'}))
    sm._states['A'] = state
    return sm


@pytest.mark.parametrize(
    'make',
    [
        lambda: added_late(Outcomes(outcomes=['ok'])),
        lambda: around(added_late(Outcomes(outcomes=['ok']))),
        lambda: around(concurrence({'done': {'A': 'ok'}}, A=Outcomes(outcomes=['ok']))),
    ],
)
def test_a_state_that_raises_as_it_is_looked_at_is_named_with_its_line(make):
    with pytest.raises(MachineFaultError) as raised:
        faults_of(make(), 'TOP')
    text, path = str(raised.value), os.path.abspath(__file__)
    assert re.match(r'TOP/(INNER/)?A: it cannot be checked', text), text
    assert "KeyError: 'gripper' ({} line ".format(path) in text and len(text.splitlines()) == 1


def error_of(build):
    try:
        build()
    except Exception as err:
        return refused_while_built(type(err), err, err.__traceback__)


@pytest.mark.parametrize(
    'build',
    [
        lambda: machine(A=(state('ok'), {'okay': 'done'})),
        lambda: smach.StateMachine.add('A', state('ok')),
        lambda: smach.Concurrence(['done'], 'dome'),
    ],
)
def test_an_error_of_smach_while_a_machine_is_built_is_told_with_its_line(build, monkeypatch):
    # upstream's SMACH leaves a container open whose construction has raised
    monkeypatch.setattr(smach.Container, '_construction_stack', [])
    assert 'test_machine_faults.py line ' in str(error_of(build))
    assert 'SMACH refuses the machine: Invalid' in str(error_of(build))


def test_the_outcome_map_is_told_that_smach_refuses_by_a_key_alone(monkeypatch):
    monkeypatch.setattr(smach.Container, '_construction_stack', [])

    def build():
        with smach.Concurrence(['done'], 'done', outcome_map={'done': {'LEFF': 'ok'}}):
            smach.Concurrence.add('LEFT', state('ok'))

    assert "its outcome map waits for the state 'LEFF', which is none of its states (did you " in (
        str(error_of(build))
    )


def test_an_error_of_the_script_itself_is_none_of_smach():
    def build():
        raise ValueError('no robot')

    assert error_of(build) is None
    assert error_of(lambda: machine().userdata['missing']) is None
