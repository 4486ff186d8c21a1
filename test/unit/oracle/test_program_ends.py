"""A state that ends the program by sys.exit: nothing failed, and nothing is done again."""

import sys
import threading

import pytest
from machines import FakeExpert, Scripted, Watched, chain_of

import smach
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.oracle.records.facts import ENDED_BY


class Ends(smach.State):
    """Ends the program."""

    def __init__(self, error=SystemExit):
        smach.State.__init__(self, ['ok', 'aborted'])
        self.visits = 0
        self.error = error

    def execute(self, ud):
        self.visits += 1
        if self.error is SystemExit:
            sys.exit(3)
        raise self.error


def alone(state):
    return state


def nested(state):
    machine = smach.StateMachine(['ok', 'aborted'])
    with machine:
        smach.StateMachine.add('DEEP', state)
    return machine


def concurrent(state):
    container = smach.Concurrence(
        ['ok', 'aborted'], default_outcome='aborted', outcome_map={'ok': {'ONE': 'ok'}}
    )
    with container:
        smach.Concurrence.add('ONE', state)
        smach.Concurrence.add('TWO', Scripted('ok', outcomes=('ok', 'aborted')))
    return container


def iterated(state):
    container = smach.Iterator(
        ['ok', 'aborted'], [], [], it=lambda: range(3), it_label='item', exhausted_outcome='ok'
    )
    with container:
        smach.Iterator.set_contained_state('EACH', state, loop_outcomes=['ok'])
    return container


PLACES = [
    alone,
    nested,
    concurrent,
    iterated,
    lambda state: nested(concurrent(state)),
    lambda state: concurrent(concurrent(state)),
    lambda state: iterated(nested(state)),
    lambda state: concurrent(nested(state)),
]
NAMES = [
    'alone',
    'nested',
    'concurrent',
    'iterated',
    'concurrent in nested',
    'concurrent in concurrent',
    'nested in iterated',
    'nested in concurrent',
]


def error_of(execute):
    with pytest.raises(BaseException) as raised:
        execute()
    return raised.type, getattr(raised.value, 'code', None)


@pytest.mark.parametrize('place', PLACES, ids=NAMES)
@pytest.mark.parametrize('error', [SystemExit, KeyboardInterrupt])
@pytest.mark.parametrize('limit_s', [None, 30.0])
def test_a_state_that_ends_the_program_is_no_failure_and_runs_once(place, error, limit_s):
    bare = error_of(chain_of(Scripted(), place(Ends(error)), Scripted()).execute)
    state = Ends(error)
    settings = {'states': {'*': {'time_limit_s': limit_s}}} if limit_s else {}
    machine = Watched(
        chain_of(Scripted(), place(state), Scripted()), expert=FakeExpert(), settings=settings
    )
    ended = error_of(machine.machine.execute)
    assert ended == bare or ended == (error, 3 if error is SystemExit else None)
    assert state.visits == 1
    assert not machine.of(EventKind.FAILURE, EventKind.DECISION, EventKind.QUERY_OPENED)
    (end,) = machine.of(EventKind.TRIAL_END)
    assert end.data[ENDED_BY] == 'stopped'
    assert machine.rate('B').failures == 0
    assert not machine.machine.is_running() and threading.current_thread().is_alive()


def test_an_error_of_the_author_that_hides_an_exit_is_a_failure():
    class Hides(Ends):
        def execute(self, ud):
            try:
                return super().execute(ud)
            except SystemExit:
                return self.has_no_plan()

        def has_no_plan(self):
            raise ValueError('no plan')

    machine = Watched(chain_of(Hides()), settings={'max_recoveries': 1})
    with pytest.raises(smach.InvalidUserCodeError):
        machine.machine.execute()
    assert len(machine.of(EventKind.FAILURE)) == 2


class EndsAt:
    """A value in the userdata that ends the program the n-th time that it is copied or pickled."""

    def __init__(self, count):
        self.left = count

    def __reduce_ex__(self, protocol):
        self.left -= 1
        if self.left < 1:
            raise KeyboardInterrupt
        return EndsAt, (9,)


@pytest.mark.parametrize('count', range(1, 7))
def test_an_exit_within_a_value_of_the_userdata_ends_the_program(count):
    """It is copied as a state is entered, compared and copied by a recovery, and restored."""
    settings = {'deep_copy_keys': ['cup'], 'states': {'B': {'preconditions': ['A']}}}
    machine = Watched(chain_of(Scripted(), Scripted('aborted')), settings=settings)
    value = machine.machine.userdata.cup = EndsAt(count)
    with pytest.raises(KeyboardInterrupt):
        machine.machine.execute()
    assert not value.left


@pytest.mark.parametrize('told', [True, False])
def test_an_exit_behind_an_error_of_smach_ends_the_program_unless_it_is_hidden(told):
    def ends(state, ud):
        error = smach.InvalidUserCodeError('no more')
        error.__context__ = SystemExit(3)
        error.__suppress_context__ = not told  # as `from None` does
        raise error

    machine = Watched(chain_of(Scripted(ends)))
    if told:
        with pytest.raises(smach.InvalidUserCodeError):
            machine.run()
    else:
        assert machine.run() == 'done'
    assert len(machine.of(EventKind.FAILURE)) == (not told)
