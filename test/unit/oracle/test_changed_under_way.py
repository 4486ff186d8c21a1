"""States that come in the place of others between two executions, or during one."""

import copy
import os
import signal
import threading
from typing import Any, List

import pytest
from branch_machines import both
from guarded_machines import chain
from machines import Scripted, Watched, chain_of
from waiting import wait_for

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.oracle.smach_private import iterated_state_of, set_items


def items_of(state: smach.State, *items: Any) -> smach.Iterator:
    """An Iterator over items, which ends with 'done'."""
    iterator = smach.Iterator(
        outcomes=['done', 'aborted'],
        input_keys=[],
        output_keys=[],
        it=list(items),
        it_label='item',
        exhausted_outcome='done',
    )
    with iterator:
        smach.Iterator.set_contained_state('EACH', state, loop_outcomes=['ok'])
    return iterator


def machine_of(state: smach.State) -> smach.StateMachine:
    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('ALL', state)
    return machine


@pytest.mark.parametrize('is_wrapped', [False, True])
def test_an_outcome_that_has_become_a_state_is_entered(is_wrapped: bool) -> None:
    machine = smach.StateMachine(outcomes=['ok', 'CLEAN', 'done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('A', Scripted(outcomes=['ok']), {'ok': 'CLEAN'})
    if is_wrapped:
        OracleContainer.wrap(machine)
    assert [machine.execute() for _ in range(3)] == ['CLEAN'] * 3
    clean = Scripted(outcomes=['ok'])
    with machine:
        smach.StateMachine.add('CLEAN', clean, {'ok': 'done'})
    assert machine.execute() == 'done' and clean.runs == 1


@pytest.mark.parametrize('is_wrapped', [False, True])
def test_a_state_that_takes_the_place_of_an_item_is_executed(is_wrapped: bool) -> None:
    def replace(*args: Any) -> None:
        with iterator:
            smach.Iterator.set_contained_state('EACH', second, loop_outcomes=['ok'])

    first, second = Scripted(outcomes=['ok']), Scripted(outcomes=['ok'])
    iterator = items_of(first, 1, 2, 3)
    iterator.register_transition_cb(replace)
    machine = machine_of(iterator)
    if is_wrapped:
        OracleContainer.wrap(machine)
    assert machine.execute() == 'done'
    assert (first.runs, second.runs) == (1, 2)


def test_a_shallow_copy_executes_its_own_state_while_the_original_runs() -> None:
    def run_the_copy(state: smach.State, ud: Any) -> str:
        twin = copy.copy(iterator)
        with twin:
            smach.Iterator.set_contained_state('EACH', of_the_copy, loop_outcomes=['ok'])
        assert twin.execute() == 'done'
        return 'ok'

    original, of_the_copy = Scripted(run_the_copy, outcomes=['ok']), Scripted(outcomes=['ok'])
    iterator = items_of(original, 1, 2)
    assert OracleContainer.wrap(machine_of(iterator)).execute() == 'done'
    assert (original.runs, of_the_copy.runs) == (2, 2)


def test_a_child_that_a_precondition_forks_ends_with_its_function() -> None:
    children: List[int] = []

    def fork(ud: Any) -> bool:
        child = os.fork()
        if child:
            children.append(child)
        return True

    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('A', Scripted('aborted'), {'ok': 'done'})
    assert Watched(machine, preconditions={'A': [fork]}).run() == 'done'
    (child,) = children
    try:
        assert wait_for(lambda: os.waitpid(child, os.WNOHANG) == (child, 0))
    except AssertionError:
        os.kill(child, signal.SIGKILL)
        raise


class OwnIterator(smach.Iterator):
    """Executes by itself, so that it asks no hook of the engine's."""

    def execute(self, *args: Any) -> Any:
        """Execute as its base does."""
        return smach.Iterator.execute(self, *args)


def test_a_state_that_was_exchanged_while_an_iterator_executes_stays() -> None:
    other, items = Scripted(), [3]

    def exchange(*args: Any) -> str:
        set_items(iterator, items, other)
        return 'ok'

    iterator = OwnIterator(['done', 'aborted'], [], [], it=[1], exhausted_outcome='done')
    with iterator:
        smach.Iterator.set_contained_state('EACH', Scripted(exchange), loop_outcomes=['ok'])
    assert OracleContainer.wrap(machine_of(iterator)).execute() == 'done'
    assert iterated_state_of(iterator) is other and iterator._items is items


def test_a_way_that_was_taken_from_the_oracle_is_drawn_again() -> None:
    state = Scripted('aborted', 'ok', 'aborted')
    machine = Watched(chain_of(state))
    assert machine.run() == 'done'
    ways = machine.machine._transitions
    del ways['ORACLE']['A']
    assert machine.run() == 'done' and state.runs == 4
    assert ways['ORACLE']['A'] == 'A'


def test_ways_of_others_in_place_of_those_of_the_oracle_are_replaced() -> None:
    machine = Watched(chain_of(Scripted('aborted', 'ok', 'aborted')))
    assert machine.run() == 'done'
    ways = machine.machine._transitions
    ways['ORACLE'] = dict.fromkeys(map(str, range(len(ways['ORACLE']))))
    assert machine.run() == 'done'
    assert ways['ORACLE']['A'] == 'A'


def test_an_outcome_that_a_branch_gets_under_way_is_one_of_its_own() -> None:
    def register(state: smach.State, ud: Any) -> str:
        left.register_outcomes(['more'])
        return 'ok'

    left, right = Scripted('more'), Scripted()
    concurrence = both(left, right, outcome_map={'done': {'RIGHT': 'ok'}})
    watched = Watched(chain(FIRST=Scripted(register), BOTH=concurrence))
    assert watched.run() == 'done' and left.runs == 1
    assert not watched.of(EventKind.FAILURE)


@pytest.mark.skipif(
    bool(os.environ.get('SMACH_UPSTREAM')), reason='its shallow copies share their threads'
)
def test_a_copy_of_a_concurrence_that_a_state_executes_runs_bare() -> None:
    def run_the_copy(state: smach.State, ud: Any) -> str:
        assert ended.wait(20)
        outcomes.append(copy.copy(concurrence).execute())
        return 'ok'

    outcomes: List[str] = []
    ended = threading.Event()
    left, right = Scripted(run_the_copy), Scripted('ok', 'aborted')
    concurrence = both(left, right, child_termination_cb=lambda _: ended.set())
    machine = OracleContainer.wrap(chain(BOTH=concurrence), settings={'policy': 'retry'})
    assert machine.execute() == 'done'
    assert (outcomes, right.runs) == (['aborted'], 2)
