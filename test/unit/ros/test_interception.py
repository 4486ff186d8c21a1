"""The programs under oracle_run whose machines are executed in a way of their own."""

import threading

from forked import in_a_fork

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.ros.oracle_run.interception import Interception

LIMIT_S = 10.0


def machine_of(make=smach.StateMachine):
    """A machine whose state fails at each other visit, the first one included."""
    visits = []

    def work(userdata):
        visits.append(None)
        return 'aborted' if len(visits) % 2 else 'succeeded'

    machine = make(outcomes=['succeeded', 'aborted'])
    with machine:
        smach.StateMachine.add('WORK', smach.CBState(work, outcomes=['succeeded', 'aborted']))
    return machine


def trials_of(begin, make=smach.StateMachine):
    """What `begin(machine)` returns, and the ids of the trials, in a program under oracle_run."""

    def program():
        trials = []

        class Counting(OracleContainer):
            def new_trial_id(self):
                trials.append(len(trials))
                return str(len(trials))

        Interception(lambda machine: Counting.wrap(machine) and None).install()
        return begin(machine_of(make)), len(trials)

    return in_a_fork(program)


def test_a_method_that_was_taken_before_begins_a_trial_each_time():
    def begin(machine):
        execute = machine.execute
        return [execute() for _ in range(3)]

    assert trials_of(begin) == (['succeeded'] * 3, 3)


def test_a_method_of_the_machines_own_class_that_was_taken_before_runs_once_a_trial():
    entered = []

    class Own(smach.StateMachine):
        def execute(self, *args):
            entered.append(None)
            return super().execute(*args)

    def begin(machine):
        execute = machine.execute
        return [execute() for _ in range(3)], len(entered)

    assert trials_of(begin, Own) == ((['succeeded'] * 3, 3), 3)


def test_an_execute_that_one_machine_was_given_runs_once_a_trial():
    """So does a library that puts its own function around that of every state."""

    def begin(machine):
        entered, execute = [], machine.execute

        def around(*args):
            entered.append(None)
            return execute(*args)

        machine.execute = around
        return [machine.execute() for _ in range(3)], len(entered)

    assert trials_of(begin) == ((['succeeded'] * 3, 3), 3)


def test_a_machine_runs_while_it_is_put_under_an_oracle():
    """A program may wait for its end from the moment at which it has started the thread."""

    def program():
        machine, told = machine_of(), []
        reached, go = threading.Event(), threading.Event()

        def wrap(each):
            reached.set()
            assert go.wait(LIMIT_S)
            OracleContainer.wrap(each)

        Interception(wrap).install()
        thread = threading.Thread(target=machine.execute)
        thread.start()
        assert reached.wait(LIMIT_S)
        told.append(machine.is_running())
        go.set()
        thread.join()
        return told + [machine.is_running()]

    assert in_a_fork(program) == [True, False]
