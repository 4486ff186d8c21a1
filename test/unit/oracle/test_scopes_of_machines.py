"""The waits of a machine end at once when it is preempted, and by the reason that comes first."""

import threading

import pytest
from held_machines import Held, eventually
from machines import FakeExpert, FakeHealth, Scripted, Watched, chain_of, watched

import smach
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.oracle.scope import scope
from smach_oracle.oracle.scope.clock import Clock, PausableClock
from smach_oracle.oracle.scope.scope import Reason, Scope, inside

SOON_S = 15.0  # much less than the period below


@pytest.fixture
def never_looks(monkeypatch):
    """Nobody looks again by himself: a wait ends only where it is woken."""
    monkeypatch.setattr(scope, 'LOOK_S', 60.0)


def preempted_once(machine, kind, top=None):
    """Preempt a machine of these once an event has come. Return how it ends."""
    held = threading.Event()
    machine.machine.events.observers.append(
        lambda event: held.set() if event.kind is kind else None
    )
    with machine.begin():
        assert held.wait(SOON_S)
        (top or machine.machine).request_preempt()
        machine._thread.join(SOON_S)
        assert not machine.running(), 'nobody has woken it'
    return machine.outcome


def around(label, child):
    outer = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with outer:
        smach.StateMachine.add(label, child, {'done': 'done'})
    return outer


@pytest.mark.parametrize('depth', [0, 2])
def test_a_hold(never_looks, depth):
    tree = chain_of(Scripted(), Scripted())
    for _ in range(depth):
        tree = around('IN', tree)
    machine = Held(tree)
    machine.hand.set_breakpoint('B')
    assert preempted_once(machine, EventKind.HOLD_START) == 'preempted'
    assert [event.outcome for event in machine.of(EventKind.HOLD_END)] == ['preempted']


def items_of(state):
    items = smach.Iterator(
        outcomes=['done', 'aborted', 'preempted'],
        input_keys=[],
        output_keys=[],
        it=[1, 2],
        it_label='x',
        exhausted_outcome='done',
    )
    with items:
        smach.Iterator.set_contained_state('ITEM', state, loop_outcomes=['ok'])
    return items


def test_a_hold_between_two_items(never_looks):
    machine = Held(around('ITEMS', items_of(Scripted())), nested=False)
    machine.hand.pause()
    with machine.begin():
        eventually(machine.held)
        machine.hand.step()
        eventually(lambda: machine.held() == ['SM_ROOT/ITEMS/ITEM'])
        machine.machine.request_preempt()
        machine._thread.join(SOON_S)
        assert not machine.running(), 'nobody has woken it'


def test_a_hold_in_a_branch_that_another_branch_ends(never_looks):
    begun, held = threading.Event(), threading.Event()

    def is_held_afterwards(state, ud):
        assert begun.wait(SOON_S)
        machine.hand.pause()
        return 'aborted'

    def ends_all(state, ud):
        begun.set()
        assert held.wait(SOON_S)
        return 'ok'

    both = smach.Concurrence(
        outcomes=['done'],
        default_outcome='done',
        child_termination_cb=lambda outcomes: outcomes['B'] is not None,
    )
    with both:
        smach.Concurrence.add('A', Scripted(is_held_afterwards))
        smach.Concurrence.add('B', Scripted(ends_all))
    machine = Held(around('BOTH', both))
    machine.machine.events.observers.append(
        lambda event: held.set() if event.kind is EventKind.HOLD_START else None
    )
    with machine.begin():
        machine._thread.join(SOON_S)
        assert not machine.running(), 'nobody has woken it'
    assert [event.outcome for event in machine.of(EventKind.HOLD_END)] == ['preempted']


def test_an_open_question(never_looks):
    def ask(question, cancelled, progress):
        assert cancelled.wait(SOON_S)

    machine = Held(
        around('IN', chain_of(Scripted('aborted'))),
        expert=FakeExpert(ask),
        settings={'max_recoveries': 0, 'deadline_s': 0},
    )
    assert preempted_once(machine, EventKind.QUERY_OPENED) == 'preempted'
    assert [event.text for event in machine.of(EventKind.QUERY_CANCELLED)] == ['preempted']


def test_a_wait_of_a_policy(never_looks):
    machine = Held(
        chain_of(Scripted('aborted')), settings={'policy': {'name': 'ladder', 'wait_s': 3600}}
    )
    assert preempted_once(machine, EventKind.DECISION) == 'preempted'


def test_a_wait_for_health(never_looks):
    health = FakeHealth()

    def trips(state, ud):
        health.now = 'motors: off'
        return 'aborted'

    machine = Held(chain_of(Scripted(trips)), health=health, settings={'health_settle_s': 0.05})
    assert preempted_once(machine, EventKind.HEALTH_WAIT_START) == 'preempted'


def test_a_function_that_is_a_precondition(never_looks):
    go = threading.Event()
    machine = Held(
        chain_of(Scripted('aborted')),
        preconditions={'A': [lambda ud: go.wait(60.0)]},
        settings={'grace_period_s': 0.0, 'states': {'A': {'time_limit_s': 300.0}}},
    )
    assert preempted_once(machine, EventKind.PRECONDITION_START) == 'preempted'
    go.set()


# -- several reasons at once


def test_a_hold_of_a_machine_that_is_preempted_as_the_process_goes_down(monkeypatch):
    machine = Held(chain_of(Scripted(), Scripted()))
    machine.hand.set_breakpoint('B')

    def goes_down(event):
        if event.kind is EventKind.HOLD_START:
            monkeypatch.setattr(smach, 'is_shutdown', lambda: True)
            machine.machine._preempt_requested = True  # in this very moment, by another thread

    machine.machine.events.observers.append(goes_down)
    with machine.begin():
        machine.end()
    assert [event.outcome for event in machine.of(EventKind.HOLD_END)] == ['preempted']


def test_a_hold_between_two_items_as_the_process_goes_down(monkeypatch):
    items = items_of(Scripted())
    machine = Held(around('ITEMS', items), nested=False)

    def goes_down(event):
        if event.kind is EventKind.HOLD_START and event.path.endswith('ITEMS'):
            monkeypatch.setattr(smach, 'is_shutdown', lambda: True)
            items.request_preempt()

    machine.machine.events.observers.append(goes_down)
    machine.hand.pause()
    with machine.begin():
        eventually(machine.held)
        machine.hand.step()
        machine._thread.join(SOON_S)
    ends = [event.outcome for event in machine.of(EventKind.HOLD_END)]
    assert ends == ['stepped', 'preempted']


def test_a_question_that_a_preempt_ends_says_so_as_the_process_goes_down(monkeypatch):
    def ask(question, cancelled, progress):
        machine.machine.request_preempt()
        monkeypatch.setattr(smach, 'is_shutdown', lambda: True)
        assert cancelled.wait(SOON_S)

    machine = watched(
        Scripted('aborted'),
        expert=FakeExpert(ask),
        settings={'max_recoveries': 0, 'deadline_s': 0},
    )
    machine.run()
    assert [event.text for event in machine.of(EventKind.QUERY_CANCELLED)] == ['preempted']


def test_of_a_machine_that_is_left_behind_nothing_else_counts():
    """Its preempt, which came before, does not send it to the clean-up that its author drew."""
    machine = Watched(chain_of(Scripted(), Scripted()))
    node = machine.machine._oracle
    run = Scope(time=PausableClock(Clock()))
    with inside(run):
        node.execution.look_around()
    machine.machine.request_preempt()
    assert node.execution.scope.reason is Reason.PREEMPTED and not node.execution.is_left_behind()
    run.cancel(Reason.LEFT_BEHIND)
    assert node.execution.scope.reason is Reason.LEFT_BEHIND and node.execution.is_left_behind()
    node.tree.early_end.keep()
    assert node.execution.scope.reason is Reason.EARLY_END
