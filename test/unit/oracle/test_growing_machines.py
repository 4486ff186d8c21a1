"""A machine may grow or execute in one thread while another one looks at it, copies it or forks."""

import contextlib
import copy
import gc
import pickle
import sys
import threading

import pytest
from forked import in_a_fork

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.machine.nesting import nodes_of
from smach_oracle.oracle.machine.tree_node import marked_node

GROWN = 600  # states
COPIES = 60


@contextlib.contextmanager
def threads_that_alternate_often():
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        yield
    finally:
        sys.setswitchinterval(interval)


def test_a_tree_can_be_looked_through_while_a_machine_of_it_grows():
    top = smach.StateMachine(['done'])
    with top:
        smach.StateMachine.add('A', smach.CBState(lambda ud: 'done', outcomes=['done']))
    OracleContainer.wrap(top)
    grown, looks, errors = threading.Event(), [], []

    def look():
        while not grown.is_set():
            try:
                looks.append(len(nodes_of(top)))
            except RuntimeError as err:
                errors.append(err)

    def collected(phase, info):
        """Run code in the midst of what is one step to other threads, as a finalizer does."""
        return [phase for _ in range(50)]

    threshold = gc.get_threshold()
    gc.callbacks.append(collected)
    gc.set_threshold(5)
    try:
        with threads_that_alternate_often():
            thread = threading.Thread(target=look)
            thread.start()
            for number in range(GROWN):
                with top:
                    state = smach.CBState(lambda ud: 'done', outcomes=['done'])
                    smach.StateMachine.add('X{}'.format(number), state)
            grown.set()
            thread.join(20)
    finally:
        gc.set_threshold(*threshold)
        gc.callbacks.remove(collected)
    assert looks and not errors


class Now(smach.State):
    """Fails now and then, until it is told that this is enough."""

    def __init__(self, every):
        smach.State.__init__(self, outcomes=['ok', 'aborted', 'over'])
        self.visits, self.every, self.is_enough = 0, every, False

    def execute(self, ud):
        self.visits += 1
        if self.is_enough:
            return 'over'
        return 'ok' if self.visits % self.every else 'aborted'


def going_round(every):
    machine = smach.StateMachine(['over', 'aborted'])
    states = {'A': Now(every), 'B': Now(every)}
    with machine:
        smach.StateMachine.add('A', states['A'], {'ok': 'B'})
        smach.StateMachine.add('B', states['B'], {'ok': 'A'})
    return machine, states


@pytest.mark.parametrize('copied', [copy.deepcopy, pickle.dumps, copy.copy])
@pytest.mark.parametrize('every', [10**9, 3], ids=['plain', 'failing'])
def test_a_machine_can_be_copied_while_it_executes(copied, every):
    machine, states = going_round(every)
    OracleContainer.wrap(machine, settings={'max_recoveries': 10**9})
    ended, errors = [], []
    with threads_that_alternate_often():
        thread = threading.Thread(target=lambda: ended.append(machine.execute()))
        thread.start()
        try:
            for _ in range(COPIES):
                try:
                    copied(machine)
                except RuntimeError as err:
                    errors.append(err)
        finally:
            for state in states.values():
                state.is_enough = True
        thread.join(20)
    assert ended == ['over'] and not errors


def test_a_child_goes_on_that_was_forked_while_another_thread_read_a_rate():
    reads, has_forked, visits = threading.Event(), threading.Event(), []

    def read():
        with marked_node(machine).record('A')._lock:
            reads.set()
            has_forked.wait(20)

    def fork(ud):
        thread = threading.Thread(target=read)
        thread.start()
        assert reads.wait(20)
        visits.append(in_a_fork(lambda: machine.rates()[0].state))
        has_forked.set()
        thread.join()
        return 'done'

    machine = smach.StateMachine(['done'])
    with machine:
        smach.StateMachine.add('A', smach.CBState(fork, outcomes=['done']))
    OracleContainer.wrap(machine)
    assert machine.execute() == 'done' and visits == ['A']
