"""A plain success takes a short way from its second time on, and nobody sees that.

Each machine here has run before, so that all its transitions are known.
"""

import threading

import pytest
from machines import FakeExpert, Scripted, Watched, chain_of, goto, watched

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.oracle.records.facts import ENDED_BY, TrialEnd


def run_before(machine):
    """A machine that has run twice."""
    assert [machine.execute(), machine.execute()] == ['done', 'done']
    return machine


def test_no_state_begins_after_a_shutdown(monkeypatch):
    first, last = Scripted(), Scripted()
    machine = run_before(watched(first, last).machine)

    def shut_down(state, ud):
        monkeypatch.setattr(smach, 'is_shutdown', lambda: True)
        return 'ok'

    first.script = [shut_down]
    assert machine.execute() is None
    assert last.runs == 2


@pytest.mark.skipif(not hasattr(smach.StateMachine, 'request_pause'), reason='it has no pause')
def test_no_state_begins_while_the_engine_pauses():
    paused, begun = threading.Event(), threading.Event()
    first, last = Scripted(), Scripted()
    machine = run_before(watched(first, last).machine)
    first.script = [lambda state, ud: (machine.request_pause(), paused.set(), 'ok')[2]]
    last.script = [lambda state, ud: (begun.set(), 'ok')[1]]
    early = []

    def resume():
        assert paused.wait(20)
        early.append(begun.wait(0.1))
        machine.request_resume()

    thread = threading.Thread(target=resume)
    thread.start()
    assert machine.execute() == 'done'
    thread.join()
    assert early == [False]


def test_a_state_reads_the_userdata_that_its_machine_has_now():
    seen = []

    def read(state, ud):
        seen.append(ud.x)
        machine.userdata = smach.UserData()
        machine.userdata.x = len(seen)
        return 'ok' if len(seen) % 3 == 0 else 'again'

    reader = Scripted(*[read] * 6, outcomes=['ok', 'again'], input_keys=['x'])
    bare = smach.StateMachine(outcomes=['done'])
    with bare:
        smach.StateMachine.add('A', reader, {'ok': 'done', 'again': 'A'})
    machine = OracleContainer.wrap(bare)
    machine.userdata.x = 0
    run_before(machine)
    assert seen == [0, 1, 2, 3, 4, 5]


def test_a_step_back_leads_to_the_state_before_one_that_came_twice():
    steps = ['again', 'ok'] * 2 + ['again', 'aborted', 'ok']
    last = Scripted(*steps, outcomes=['ok', 'again', 'aborted'])
    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('A', Scripted(), {'ok': 'B'})
        smach.StateMachine.add('B', Scripted(), {'ok': 'C'})
        smach.StateMachine.add('C', last, {'ok': 'done', 'again': 'C'})
    machine = Watched(machine, settings={'policy': 'step_back'})
    run_before(machine.machine)
    machine.events.clear()
    assert machine.run() == 'done'
    assert machine.visits() == ['A', 'B', 'C', 'C', 'B', 'C']


class TellsTransitions(OracleContainer):
    """Has its own way to tell transitions."""

    def call_transition_cbs(self):
        self.userdata.told += 1
        OracleContainer.call_transition_cbs(self)


class CountsSteps(OracleContainer):
    """Has its own step."""

    def _update_once(self):
        self.userdata.told += 1
        return OracleContainer._update_once(self)


@pytest.mark.parametrize('cls, times', [(TellsTransitions, 2), (CountsSteps, 3)])
def test_a_class_of_a_users_hears_of_each_state(cls, times):
    machine = chain_of(Scripted(), Scripted(), Scripted(), machine_class=cls)
    machine.userdata.told = 0
    run_before(machine)
    assert machine.userdata.told == 2 * times


def test_a_machine_that_its_own_state_has_executed_does_not_go_on():
    first, last = Scripted(), Scripted()
    machine = run_before(watched(first, last).machine)
    first.script = [lambda state, ud: machine.execute() and 'ok', 'ok']
    assert machine.execute() is None
    assert last.runs == 3


def test_a_step_that_was_set_on_a_machine_itself_is_made_for_each_state():
    machine = run_before(watched(Scripted(), Scripted(), Scripted()).machine)
    step, steps = machine._update_once, []
    machine._update_once = lambda: (steps.append(None), step())[1]
    assert machine.execute() == 'done'
    assert len(steps) == 3


class AsksElsewhere(OracleContainer):
    """Has another place where a stop is asked for."""

    is_asked = False

    def preempt_requested(self):
        return self.is_asked or OracleContainer.preempt_requested(self)


def test_a_preempt_that_only_the_class_knows_of_is_passed_on():
    def obey(state, ud):
        return 'preempted' if state.preempt_requested() else 'ok'

    first, last = Scripted(), Scripted(*[obey] * 3)
    machine = run_before(chain_of(first, last, machine_class=AsksElsewhere))
    first.script = [lambda state, ud: setattr(machine, 'is_asked', True) or 'ok']
    assert machine.execute() == 'preempted'


class RunsTwice(smach.StateMachine):
    """Runs twice in one execution."""

    def execute(self, parent_ud=None):
        smach.StateMachine.execute(self, parent_ud)
        return smach.StateMachine.execute(self, parent_ud)


def test_the_second_run_of_an_execution_restores_nothing_of_the_first():
    def count(outcome):
        return lambda state, ud: setattr(ud, 'n', ud.n + 1) or outcome

    seen = []
    first = Scripted(count('ok'), count('aborted'), io_keys=['n'])
    last = Scripted(*[lambda state, ud: seen.append(ud.n) or 'ok'] * 2, input_keys=['n'])
    machine = chain_of(first, last, machine_class=RunsTwice)
    asks = {'policy': 'always_ask'}
    OracleContainer.wrap(machine, settings=asks, expert=FakeExpert(goto('B')))
    machine.userdata.n = 0
    assert machine.execute() == 'done' and seen == [1, 2]


def test_a_machine_may_have_a_plain_lock():
    machine = watched(Scripted(), Scripted()).machine
    machine._state_transitioning_lock = threading.Lock()
    run_before(machine)


def test_a_state_that_has_none_as_an_outcome_fails_where_it_raises():
    first = Scripted(*[None] * 3, ValueError('slipped'), outcomes=('ok', None))
    machine = smach.StateMachine(['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('A', first, {'ok': 'done', None: 'B'})
        smach.StateMachine.add('B', Scripted(), {'ok': 'done'})
    wrapped = OracleContainer.wrap(machine)
    assert [wrapped.execute() for _ in range(4)] == ['done'] * 4
    assert {row.state: row.failures for row in wrapped.rates()} == {'A': 1, 'B': 0}


def test_each_state_is_preempted_while_only_the_class_knows_of_a_preempt():
    """But the one behind a state that has serviced it."""
    seen = []

    def look(state, ud):
        seen.append(state.preempt_requested())
        state.service_preempt()
        return 'ok'

    machine = chain_of(Scripted(), *[Scripted(look) for _ in range(3)], machine_class=AsksElsewhere)
    machine._states['A'].script = [lambda state, ud: setattr(machine, 'is_asked', True) or 'ok']
    machine.execute()
    assert seen == [True, False, True]


def test_an_end_by_preempted_teaches_nothing_however_often_it_comes():
    machine = smach.StateMachine(['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('A', Scripted(*['preempted'] * 3), {'ok': 'done', 'preempted': 'B'})
        smach.StateMachine.add('B', Scripted(), {'ok': 'done'})
    wrapped = OracleContainer.wrap(machine)
    assert [wrapped.execute() for _ in range(3)] == ['done'] * 3
    assert {row.state: row.successes for row in wrapped.rates()} == {'A': 0, 'B': 3}


def test_a_trial_that_a_shutdown_has_ended_says_so_though_that_is_over(monkeypatch):
    def set_shutdown(is_shutdown):
        monkeypatch.setattr(smach, 'is_shutdown', lambda: is_shutdown)

    first = Scripted()
    machine = watched(first, Scripted())
    run_before(machine.machine)
    machine.machine.events.observers.append(
        lambda event: set_shutdown(False) if event.kind is EventKind.CONTAINER_END else None
    )
    first.script = [lambda state, ud: set_shutdown(True) or 'ok']
    assert machine.run() is None
    assert machine.events[-1].data == {ENDED_BY: TrialEnd.SHUTDOWN.value}


def test_each_state_goes_by_its_own_transitions_while_they_change():
    """Those of the first state had led to the same place as those of the second one."""
    first, second = Scripted(), Scripted(*['next'] * 3, outcomes=('ok', 'next'))
    first.register_outcomes(['next'])
    bare = chain_of(first, second, Scripted(), Scripted())
    bare._transitions['A']['next'] = bare._transitions['B']['next'] = target = 'C'
    machine = Watched(bare)
    run_before(machine.machine)
    assert target in machine.visits()
    machine.events.clear()
    bare._transitions['B']['next'] = 'D'
    assert machine.run() == 'done'
    assert machine.visits() == ['A', 'B', 'D']
