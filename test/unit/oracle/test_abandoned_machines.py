"""A nested machine whose state overran its limit and was abandoned: it stops, and tells nothing."""

import copy
import os
import pickle
import threading

import pytest
from branch_machines import inside, iterator_over
from guarded_machines import chain
from machines import FakeExpert, Scripted, Watched, chain_of, goto, in_thread, supersede
from test_time_limits import LimitClock
from waiting import wait_for

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.records.events import EventKind, EventSource

UPSTREAM = bool(os.environ.get('SMACH_UPSTREAM'))
LIMITS = {'X': {'time_limit_s': 30.0, 'grace_period_s': 0.1}}


class Deaf(Scripted):
    """Ignores its preempts in its first execution; then ends as told."""

    def __init__(self, *script, services=False, **more):
        Scripted.__init__(self, *script, **more)
        self.stuck = threading.Event()
        self.let_go = threading.Event()
        self._services = services

    def execute(self, ud):
        if not self.let_go.is_set():
            self.stuck.set()
            assert self.let_go.wait(20)
            if self._services:
                self.service_preempt()
        return Scripted.execute(self, ud)


def drawn(label, child, *others):
    """X, which holds the child and leads to its end; OTHER, where the expert sends the machine."""
    outer = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with outer:
        smach.StateMachine.add(label, child, {'done': 'done'})
        smach.StateMachine.add('OTHER', Scripted(*others), {'ok': 'done'})
    return outer


def iterator_of(child):
    iterator = smach.Iterator(
        outcomes=['done', 'aborted', 'preempted'],
        input_keys=[],
        output_keys=[],
        it=[1, 2, 3],
        it_label='item',
        exhausted_outcome='done',
    )
    with iterator:
        smach.Iterator.set_contained_state('EACH', child, loop_outcomes=['done', 'aborted'])
    return iterator


def concurrence_of(child):
    concurrence = smach.Concurrence(
        outcomes=['done', 'aborted'],
        default_outcome='aborted',
        outcome_map={'done': {'ONE': 'done'}},
    )
    with concurrence:
        smach.Concurrence.add('ONE', child)
    return concurrence


def threads_of_x():
    return [each for each in threading.enumerate() if 'worker of X' in each.name]


def abandoned(monkeypatch, deaf, child, *others, observed=True, **settings):
    """A machine whose X was abandoned while `deaf` was stuck."""
    LimitClock(monkeypatch).end(2, deaf.stuck)
    machine = Watched(
        drawn('X', child, *others),
        expert=FakeExpert(goto('OTHER')),
        settings=dict(settings, states=LIMITS),
    )
    if not observed:
        machine.machine.events.observers.remove(machine.events.append)
    return machine


def let_go(deaf):
    deaf.let_go.set()
    assert wait_for(lambda: not threads_of_x())


@pytest.mark.parametrize('end', ['ok', 'aborted', 'preempted', ValueError('x'), None])
@pytest.mark.parametrize('services', [False, True])
@pytest.mark.parametrize('observed', [False, True])
@pytest.mark.parametrize('recovering', ['keep', 'override'])
def test_it_stops_at_its_next_state_boundary(monkeypatch, log, end, services, observed, recovering):
    deaf, after, repaired = Deaf(end, services=services), Scripted(), Scripted()
    inner = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with inner:
        smach.StateMachine.add('A', deaf, {'ok': 'B', 'aborted': 'aborted', 'preempted': 'C'})
        smach.StateMachine.add('B', after, {'ok': 'done'})
        smach.StateMachine.add('C', repaired, {'ok': 'done'})
    machine = abandoned(monkeypatch, deaf, inner, observed=observed, author_recoveries=recovering)
    assert machine.run() == 'done'
    assert inner.is_running()
    let_go(deaf)
    assert (deaf.runs, after.runs, repaired.runs) == (1, 0, 0)
    assert not inner.is_running()
    assert {row.state: row.failures for row in inner.rates()} == {'A': 0, 'B': 0, 'C': 0}
    assert [level for level, text in log if 'stops, as' in text] == ['warn']


def test_the_way_it_has_learned_is_no_longer_taken(monkeypatch):
    deaf, after = Deaf(), Scripted()
    inner = chain_of(deaf, after)
    machine = abandoned(monkeypatch, deaf, inner, observed=False)
    deaf.let_go.set()
    assert machine.run() == 'done'
    deaf.let_go.clear()
    assert machine.run() == 'done'
    let_go(deaf)
    assert (deaf.runs, after.runs) == (2, 1)


@pytest.mark.parametrize(
    'wrap',
    [
        lambda inner: drawn('DEEP', inner),
        iterator_of,
        concurrence_of,
        lambda inner: iterator_of(concurrence_of(inner)),
    ],
)
def test_machines_below_it_stop_too(monkeypatch, wrap):
    deaf, after = Deaf('aborted'), Scripted()
    inner = chain_of(deaf, after)
    machine = abandoned(monkeypatch, deaf, wrap(inner))
    assert machine.run() == 'done'
    let_go(deaf)
    assert (deaf.runs, after.runs) == (1, 0)
    assert not inner.is_running()


def test_a_machine_that_the_state_executes_itself_stops_and_begins_no_trial(monkeypatch):
    deaf, after = Deaf(), Scripted()
    own = Watched(chain_of(deaf, after))
    outcomes = []
    state = Scripted(
        lambda state, ud: outcomes.extend([own.run(), own.run()]) or 'done',
        outcomes=('done', 'aborted', 'preempted'),
    )
    machine = abandoned(monkeypatch, deaf, state)
    assert machine.run() == 'done'
    let_go(deaf)
    assert outcomes == [None, None]
    assert (deaf.runs, after.runs) == (1, 0)
    assert own.kinds().count('TRIAL_START') == own.kinds().count('TRIAL_END') == 1


@pytest.mark.parametrize('end', ['ok', 'aborted', ValueError('x')])
def test_it_writes_no_event_into_an_ended_trial_nor_into_the_next(monkeypatch, end):
    deaf = Deaf(end)
    inner = chain_of(deaf, Scripted())
    in_second = threading.Event()
    machine = abandoned(
        monkeypatch,
        deaf,
        inner,
        'ok',
        lambda state, ud: (
            in_second.set()
            or deaf.let_go.wait(20)
            and wait_for(lambda: not threads_of_x())
            and 'ok'
        ),
    )
    assert machine.run() == 'done'
    machine.machine.expert = FakeExpert(goto('OTHER'), goto('OTHER'))
    second = in_thread(machine.run)
    assert in_second.wait(10)
    deaf.let_go.set()
    assert second.result() == 'done'
    by_trial = {}
    for event in machine.events:
        by_trial.setdefault(event.trial_id, []).append(event)
    assert len(by_trial) == 2
    for events in by_trial.values():
        assert events[-1].kind is EventKind.TRIAL_END
        assert [event.seq for event in events] == list(range(len(events)))
    first, later = by_trial.values()
    assert {event.path for event in later} == {'SM_ROOT'}
    assert [event.kind for event in first].count(EventKind.CONTAINER_END) == 1


def test_nothing_comes_after_the_end_of_a_trial(monkeypatch):
    deaf = Deaf('aborted')
    machine = abandoned(monkeypatch, deaf, chain_of(deaf, Scripted()))
    assert machine.run() == 'done'
    count = len(machine.events)
    let_go(deaf)
    assert len(machine.events) == count
    assert machine.events[-1].kind is EventKind.TRIAL_END


def test_once_it_has_stopped_it_runs_as_any_other(monkeypatch):
    deaf, after = Deaf('aborted', 'aborted', 'ok'), Scripted()
    inner = chain_of(deaf, after)
    machine = abandoned(monkeypatch, deaf, inner)
    assert machine.run() == 'done'
    let_go(deaf)
    del machine.events[:]
    assert machine.run() == 'done'
    assert machine.visits() == ['X', 'A', 'A', 'B']
    assert after.runs == 1


def test_a_bare_machine_stops_too(monkeypatch):
    deaf, after = Deaf(), Scripted()
    inner = chain_of(deaf, after)
    machine = abandoned(monkeypatch, deaf, inner, nested=False)
    assert not isinstance(inner, OracleContainer)
    assert machine.run() == 'done'
    let_go(deaf)
    assert (deaf.runs, after.runs) == (1, 0)


def test_a_machine_within_its_grace_may_still_clean_up(monkeypatch):
    cleaned = Scripted()
    polls = Scripted(
        lambda state, ud: (
            wait_for(state.preempt_requested) and (state.service_preempt() or 'preempted')
        )
    )
    inner = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with inner:
        smach.StateMachine.add('A', polls, {'ok': 'done', 'preempted': 'CLEAN'})
        smach.StateMachine.add('CLEAN', cleaned, {'ok': 'preempted'})
    machine = Watched(
        drawn('X', inner),
        expert=FakeExpert(supersede('done')),
        settings={
            'max_recoveries': 0,
            'states': {'X': {'time_limit_s': 0.1, 'grace_period_s': 20.0}},
        },
    )
    assert machine.run() == 'done'
    assert cleaned.runs == 1


def test_a_source_tells_nothing_between_two_trials():
    source, told = EventSource(pytest.fail), []
    source.observers.append(lambda event: told.append((event.trial_id, event.kind)))
    source.begin_trial('one')
    source.emit(EventKind.TRIAL_END, 'TOP')
    source.emit(EventKind.TRANSITION, 'TOP/X')
    source.begin_trial('two')
    source.emit(EventKind.TRANSITION, 'TOP/X', of_trial='one')
    source.emit(EventKind.TRIAL_START, 'TOP', of_trial='two')
    assert told == [('one', EventKind.TRIAL_END), ('two', EventKind.TRIAL_START)]


HERE = threading.Event()


class Stays(smach.State):
    """Heeds no preempt, until HERE is set."""

    def __init__(self):
        smach.State.__init__(self, ['done', 'aborted', 'preempted'])

    def execute(self, ud):
        return 'done' if HERE.wait(20) else 'aborted'


def by_pickle(machine):
    return pickle.loads(pickle.dumps(machine))


@pytest.mark.parametrize(
    'label, made',
    [
        ('A', lambda state: chain(A=state)),
        pytest.param(
            'EACH',
            lambda state: inside(iterator_over(state, (1,), loop_outcomes=['done'])),
            marks=pytest.mark.skipif(UPSTREAM, reason='its Iterator holds a lock'),
        ),
    ],
)
@pytest.mark.parametrize('copied', [copy.deepcopy, by_pickle])
def test_a_machine_of_which_a_state_was_left_behind_can_be_copied(copied, label, made):
    HERE.clear()
    settings = {'states': {label: {'time_limit_s': 0.5, 'grace_period_s': 0.0}}}
    machine = made(Stays())
    OracleContainer.wrap(machine, settings=settings, expert=FakeExpert(supersede('done')))
    assert machine.execute() == 'done'
    other = copied(machine)
    HERE.set()
    assert other.execute() == 'done'


class InTurn(smach.Concurrence):
    """A user's class that goes through its states one after the other, and does not stop."""

    def execute(self, parent_ud=None):
        self.ended = []
        for label in ('LEFT', 'RIGHT'):
            self.ended.append(self._states[label].execute(self.userdata))
        return 'done'


def in_turn(left, right):
    container = InTurn(['done', 'aborted', 'preempted'], 'aborted')
    with container:
        smach.Concurrence.add('LEFT', left)
        smach.Concurrence.add('RIGHT', right)
    return container


def test_no_branch_begins_in_what_was_abandoned(monkeypatch, log):
    deaf, right = Deaf(), Scripted()
    container = in_turn(deaf, right)
    machine = abandoned(monkeypatch, deaf, container)
    assert machine.run() == 'done'
    let_go(deaf)
    assert (right.runs, container.ended[1]) == (0, None)
    said = 'SM_ROOT/X: a branch does not begin, as the state around it was abandoned'
    assert [text for _, text in log].count(said) == 1


def test_a_branch_that_ends_after_it_was_abandoned_teaches_nothing(monkeypatch):
    deaf = Deaf()
    machine = abandoned(monkeypatch, deaf, in_turn(deaf, Scripted()), observed=False)
    deaf.let_go.set()
    assert machine.run() == 'done'
    deaf.let_go.clear()
    assert machine.run() == 'done'
    let_go(deaf)
    assert (deaf.runs, machine.rate('LEFT').successes) == (2, 1)
