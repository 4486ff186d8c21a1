"""Asking a machine to stop, at any moment, and pausing it."""

import threading
import time

import pytest
from smach_states import Fixed, Scripted, UntilPreempted, concurrence, machine, that_name
from waiting import Once, stays, wait_for

import smach
from smach_oracle.oracle import OracleContainer


def preempt(sm_holder, serviced):
    def work(state, ud):
        sm_holder[0].request_preempt()
        if serviced:
            state.service_preempt()
        return 'done'

    return work


def flagged(state, ud):
    if state.preempt_requested():
        state.service_preempt()
        return 'preempted'
    return 'done'


def test_a_running_state_is_asked_and_the_machine_ends_serviced():
    state = UntilPreempted()
    sm = machine(('A', state, None))
    asker = Once(state.started.is_set, sm.request_preempt)
    assert sm.execute() == 'preempted'
    asker.join()
    assert not sm.preempt_requested()


def test_a_state_that_ignores_the_request_hands_it_to_the_next_before_that_runs(said):
    holder = []
    sm = machine(
        ('A', Scripted(preempt(holder, False)), {'done': 'B'}), ('B', Scripted(flagged), None)
    )
    holder.append(sm)
    assert sm.execute() == 'preempted'
    assert not sm['A'].preempt_requested() and not sm.preempt_requested()
    assert len([text for text in that_name(['A', 'B'], said('info')) if '-->' not in text]) == 1


def test_a_state_that_services_the_request_and_goes_on_frees_the_rest():
    holder = []
    sm = machine(
        ('A', Scripted(preempt(holder, True)), {'done': 'B'}), ('B', Scripted(flagged), None)
    )
    holder.append(sm)
    assert sm.execute() == 'done' and not sm.preempt_requested()


def test_a_request_nobody_services_stays_with_the_machine_for_its_parent():
    holder = []
    inner = machine(('I', Scripted(preempt(holder, False)), None))
    outer = machine(('IN', inner, {'done': 'NEXT'}), ('NEXT', Scripted(flagged), None))
    holder.append(outer)
    assert outer.execute() == 'preempted'
    assert not outer.preempt_requested() and not inner.preempt_requested()


def test_a_request_before_the_start_reaches_the_first_state():
    sm = machine(('A', Scripted(flagged), None))
    sm.request_preempt()
    assert sm.execute() == 'preempted'


@pytest.mark.improvement
def test_a_second_request_reaches_a_state_that_serviced_the_first():
    seen = []

    def twice(state, ud):
        for _ in range(2):
            sm.request_preempt()
            seen.append(state.preempt_requested())
            state.service_preempt()
        return 'done'

    sm = machine(('A', Scripted(twice), None))
    sm.execute()
    assert seen == [True, True]


@pytest.mark.improvement
def test_a_request_a_state_ignored_and_the_parent_settled_does_not_meet_its_next_run():
    holder, flags = [], []

    def ignore_once(state, ud):
        flags.append(state.preempt_requested())
        if holder:
            holder.pop().request_preempt()
        return 'done'

    inner = machine(('I', Scripted(ignore_once), None))
    outer = machine(('IN', inner, {'done': 'NEXT'}), ('NEXT', Scripted(flagged), None))
    holder.append(outer)
    assert outer.execute() == 'preempted'
    assert outer.execute() == 'done' and flags == [False, False]


def test_every_run_can_be_preempted():
    state = UntilPreempted()
    sm = machine(('A', state, None))
    for _ in range(3):
        state.started.clear()
        asker = Once(state.started.is_set, sm.request_preempt)
        assert sm.execute() == 'preempted' and not sm.preempt_requested()
        asker.join()


def test_a_state_whose_request_preempt_raises_does_not_hurt_the_one_who_asks(said):
    class Broken(smach.State):
        def request_preempt(self):
            raise ValueError('broken')

        def execute(self, ud):
            sm.request_preempt()
            return 'done'

    sm = machine(('A', Broken(outcomes=['done']), None))
    assert sm.execute() == 'done'
    assert any('ValueError: broken' in text for text in that_name(['A'], said('err')))


@pytest.mark.improvement
@pytest.mark.parametrize('kind', ['start', 'transition'])
def test_a_callback_may_request_a_preempt(kind):
    sm = machine(('A', Scripted(flagged), {'done': 'B'}), ('B', Scripted(flagged), None))
    getattr(sm, 'register_%s_cb' % kind)(lambda ud, active: sm.request_preempt())
    assert sm.execute() == 'preempted'


@pytest.mark.improvement
def test_a_request_reaches_a_machine_that_only_rushes_from_state_to_state():
    visits = []

    def rush(state, ud):
        visits.append(1)
        return flagged(state, ud)

    sm = machine(('A', Scripted(rush), {'done': 'A'}))
    asker = Once(lambda: len(visits) > 100, sm.request_preempt)
    begin = time.monotonic()
    assert sm.execute() == 'preempted'
    asker.join()
    assert time.monotonic() - begin < 10.0


class LateLock(object):
    """A transitioning lock that threads other than the machine's get only once ``open_to_others``
    is set.
    """

    def __init__(self):
        self.open_to_others = threading.Event()
        self.machines_thread = threading.current_thread()
        lock = threading.RLock()
        self.acquire, self.release = lock.acquire, lock.release

    def __enter__(self):
        if threading.current_thread() is not self.machines_thread:
            self.open_to_others.wait(5.0)
        return self.acquire()

    def __exit__(self, *_):
        self.release()


@pytest.mark.improvement
def test_one_request_to_a_machine_that_rushes_stops_one_state_not_two():
    began, serviced = threading.Event(), []

    def until_requested(state, ud):
        began.set()
        wait_for(sm.preempt_requested, 5.0)
        return 'done'

    def service(state, ud):
        if state.preempt_requested():
            state.service_preempt()
            serviced.append(state)
            lock.open_to_others.set()
            asker.join(5.0)
        return 'done'

    sm = machine(
        ('A', Scripted(until_requested), {'done': 'B'}),
        ('B', Scripted(service), {'done': 'C'}),
        ('C', Scripted(service), None),
    )
    lock = sm._state_transitioning_lock = LateLock()
    asker = Once(began.is_set, sm.request_preempt)
    assert sm.execute() == 'done'
    asker.join()
    assert serviced == [sm['B']] and not sm.preempt_requested()


@pytest.mark.improvement
@pytest.mark.parametrize('wrap', [lambda sm: sm, OracleContainer.wrap])
def test_a_paused_machine_enters_no_state_until_resumed(wrap):
    entered = []

    def enter(state, ud):
        entered.append(1)
        if len(entered) == 3:
            sm.request_pause()
        return 'done' if len(entered) == 4 else 'again'

    sm = wrap(machine(('A', Scripted(enter, ['done', 'again']), {'again': 'A'})))
    thread = threading.Thread(target=sm.execute, daemon=True)
    thread.start()
    assert wait_for(lambda: entered and sm.pause_requested())
    assert stays(lambda: len(entered) == 3 and sm.is_running() and sm.pause_requested(), 0.15)
    sm.request_resume()
    thread.join(30.0)
    assert len(entered) == 4 and not sm.is_running()


@pytest.mark.improvement
def test_a_pause_reaches_the_machine_inside_and_a_preempt_ends_it():
    holder = []

    def pause(state, ud):
        holder[0].request_pause()
        return 'done'

    inner = machine(('I', Scripted(pause), {'done': 'J'}), ('J', Scripted(flagged), None))
    outer = machine(('IN', inner, None))
    holder.append(outer)
    asker = Once(inner.pause_requested, outer.request_preempt)
    assert outer.execute() == 'preempted'
    asker.join()
    assert not inner.pause_requested()


@pytest.mark.improvement
def test_a_preempt_pending_when_a_concurrence_starts_reaches_its_children():
    holder = []
    children = concurrence({'A': UntilPreempted(), 'B': UntilPreempted()})
    outer = machine(
        ('FIRST', Scripted(preempt(holder, False)), {'done': 'BOTH'}), ('BOTH', children, None)
    )
    holder.append(outer)
    begin = time.monotonic()
    assert outer.execute() == 'preempted'
    assert time.monotonic() - begin < 10.0


def test_states_start_unpreempted_and_a_request_can_be_recalled():
    state = Fixed()
    assert not state.preempt_requested()
    state.request_preempt()
    assert state.preempt_requested()
    state.recall_preempt()
    assert not state.preempt_requested()


@pytest.mark.improvement
def test_a_preempt_between_two_runs_stops_one_state_after_an_error_too():
    seen = []

    class Told(smach.State):
        def __init__(self, label):
            smach.State.__init__(self, outcomes=['ok'])
            self.label = label

        def execute(self, ud):
            seen.append((self.label, self.preempt_requested()))
            self.service_preempt()
            if seen == [('A', False), ('B', False)]:
                raise RuntimeError('the first time')
            return 'ok'

    machine = smach.StateMachine(outcomes=['ok'])
    with machine:
        smach.StateMachine.add('A', Told('A'), {'ok': 'B'})
        smach.StateMachine.add('B', Told('B'), {'ok': 'ok'})
    with pytest.raises(smach.InvalidUserCodeError):
        machine.execute()
    machine.request_preempt()
    assert machine.execute() == 'ok'
    assert seen[2:] == [('A', True), ('B', False)]


@pytest.mark.improvement
def test_a_second_request_reaches_what_runs_in_a_branch_that_has_gone_on():
    obeys, goes_on = UntilPreempted(), UntilPreempted(5.0)
    branch = machine(
        ('OBEYS', obeys, {'preempted': 'GOES_ON'}), ('GOES_ON', goes_on, {'done': 'failed'})
    )
    outer = machine(
        (
            'BOTH',
            concurrence({'BRANCH': branch}, outcome_map={'failed': {'BRANCH': 'failed'}}),
            None,
        )
    )
    askers = [Once(state.started.is_set, outer.request_preempt) for state in (obeys, goes_on)]
    assert outer.execute() == 'preempted'
    for asker in askers:
        asker.join()
    assert not outer.preempt_requested()
