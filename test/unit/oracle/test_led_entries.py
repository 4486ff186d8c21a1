"""Which visits the oracle has led to, and how long the longest one took."""

import copy
import threading

from branch_machines import iterator_over
from guarded_machines import OUTCOMES, chain
from held_machines import Held
from machines import FakeExpert, Scripted, Watched, chain_of, goto, watched
from test_still_running import SOON, asked

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.control.control import Jump
from smach_oracle.oracle.records.events import EventKind

ASKS = {'max_recoveries': 0}


def test_the_longest_visit_counts_and_not_the_latest():
    machine = watched(Scripted(lambda state, ud: threading.Event().wait(0.05) or 'ok', 'ok'))
    assert [machine.run(), machine.run()] == ['done', 'done']
    assert machine.machine._oracle.record('A').longest_s >= 0.05


def test_a_state_that_a_trial_before_was_to_enter_is_come_to_by_itself(monkeypatch):
    """All is shut down between the jump and the state."""

    def takes_long(state, ud):
        threading.Event().wait(0.9)  # three times as long as it takes to ask
        return 'ok'

    expert = FakeExpert(goto('B'))
    machine = asked(
        Scripted('aborted', 'ok'), Scripted(takes_long), expert=expert, max_recoveries=0
    )
    machine.machine.events.observers.append(
        lambda event: (
            monkeypatch.setattr(smach, 'is_shutdown', lambda: True)
            if event.kind is EventKind.JUMP
            else None
        )
    )
    assert machine.run() is None
    monkeypatch.setattr(smach, 'is_shutdown', lambda: False)
    assert machine.run() == 'done'
    assert [question.failed_state for question in expert.questions] == ['A']


def test_a_copy_that_is_made_at_a_jump_was_led_nowhere():
    def takes_long(state, ud):
        assert not threading.Event().wait(0.2)  # four times as long as it takes to ask
        return 'ok'

    expert, copies = FakeExpert(goto('B')), []
    machine = asked(
        Scripted('aborted', 'ok'),
        Scripted(takes_long, takes_long),
        expert=expert,
        max_recoveries=0,
    )
    machine.machine.events.observers.append(
        lambda event: (
            copies.append(copy.copy(machine.machine)) if event.kind is EventKind.JUMP else None
        )
    )
    assert machine.run() == 'done'
    assert {question.failed_state for question in expert.questions} == {'A', 'B'}
    del expert.questions[:]
    assert copies[0].execute() == 'done' and not expert.questions


def test_a_state_that_is_passed_by_at_a_preempt_is_begun_from_its_start_later():
    inner = chain(X=Scripted(), Y=Scripted())
    machine = smach.StateMachine(['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('FIND', Scripted('aborted'), {'ok': 'PICK'})
        smach.StateMachine.add('PICK', inner, {'preempted': 'CLEAN'})
        smach.StateMachine.add('CLEAN', Scripted(), {'ok': 'FIND'})
    expert = FakeExpert(goto('Y', container='SM_ROOT/PICK'))
    held = Held(machine, expert=expert, settings=ASKS)
    held.hand.set_breakpoint('PICK')
    with held.begin():
        held.waits_before('SM_ROOT/PICK')
        held.hand.remove_breakpoint('PICK')
        held.hand.preempt()
        assert held.end() == 'done'
    assert held.visits() == ['FIND', 'CLEAN', 'FIND', 'PICK', 'X', 'Y']


def test_a_jump_into_a_machine_that_ends_before_leaves_nothing_to_its_next_execution():
    inner = chain(FIND=Scripted('aborted'), PICK=chain(X=Scripted(), Y=Scripted()))
    machine = smach.StateMachine(['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('WORK', inner, {'preempted': 'REST'})
        smach.StateMachine.add('REST', Scripted(), {'ok': 'WORK'})
    expert = FakeExpert(goto('Y', container='SM_ROOT/WORK/PICK'))
    held = Held(machine, expert=expert, settings=ASKS)
    held.hand.set_breakpoint('PICK')
    with held.begin():
        held.waits_before('SM_ROOT/WORK/PICK')
        held.hand.remove_breakpoint('PICK')
        inner.request_preempt()
        held.waits_before('SM_ROOT/REST')
        held.hand.resume()
        assert held.end() == 'done'
    assert held.visits() == ['WORK', 'FIND', 'REST', 'WORK', 'FIND', 'PICK', 'X', 'Y']


def test_a_class_that_executes_twice_is_led_once():
    class Twice(smach.StateMachine):
        def execute(self, parent_ud=None):
            super().execute(parent_ud)
            return super().execute(parent_ud)

    inner = chain(X=Scripted(), Y=Scripted())
    inner.__class__ = Twice
    expert = FakeExpert(goto('Y', container='SM_ROOT/PICK'))
    held = Held(chain(FIND=Scripted('aborted'), PICK=inner), expert=expert, settings=ASKS)
    assert held.run() == 'done'
    assert held.visits() == ['FIND', 'PICK', 'Y', 'X', 'Y']


def test_a_wish_that_came_too_late_is_not_for_the_next_trial():
    held = Held(chain(A=Scripted(), B=Scripted()))
    held.machine._oracle.tree.control.ask_jump('SM_ROOT', Jump('B'))  # as if it still ran
    assert held.run() == 'done' and held.visits() == ['A', 'B']


def test_who_wraps_it_again_on_the_way_changes_nothing_of_where_it_is_led():
    def wraps_again(userdata, active, *args):
        if active == ['PICK']:
            OracleContainer.wrap(held.machine, settings=dict(ASKS, still_running_s=0))

    machine = chain(FIND=Scripted('aborted'), PICK=chain(X=Scripted(), Y=Scripted()))
    machine.register_transition_cb(wraps_again)
    expert = FakeExpert(goto('Y', container='SM_ROOT/PICK'))
    held = Held(machine, expert=expert, settings=dict(ASKS, still_running_s=0))
    assert held.run() == 'done' and held.visits() == ['FIND', 'PICK', 'Y']


def test_a_watched_machine_that_was_entered_in_its_middle_begins_at_its_start_the_next_time():
    machine = smach.StateMachine(outcomes=OUTCOMES)
    place = Scripted('aborted', 'again', outcomes=('ok', 'again', 'aborted'))
    with machine:
        pick = chain(B=Scripted(), C=Scripted())
        smach.StateMachine.add('PICK', pick, {'done': 'PLACE'})
        smach.StateMachine.add('PLACE', place, {'ok': 'done', 'again': 'PICK'})
    expert = FakeExpert(goto('C', container='TOP/PICK'))
    settings = {**ASKS, 'deep_copy_keys': ['any']}
    watched = Watched(machine, name='TOP', expert=expert, settings=settings)
    assert watched.run() == 'done'
    led, whole = ['PICK', 'C', 'PLACE'], ['PICK', 'B', 'C', 'PLACE']
    assert watched.visits() == [*whole, *led, *whole]


def test_a_machine_of_a_class_with_a_private_method_of_that_name_is_entered_in_its_middle():
    class Own(smach.StateMachine):
        def _start_elsewhere(self):
            raise AssertionError('it is for the author alone')

    inner = chain_of(Scripted(), Scripted(), machine_class=Own)
    states = {'N': inner, 'LAST': Scripted('aborted')}
    expert = FakeExpert(goto('B', container='TOP/N'))
    watched = Watched(chain(**states), name='TOP', expert=expert, settings=ASKS)
    assert watched.run() == 'done'
    assert watched.visits() == ['N', 'A', 'B', 'LAST', 'N', 'B', 'LAST']


def test_a_machine_that_was_led_to_and_not_entered_begins_from_its_start_later():
    first, items = Scripted(), [[], [1]]
    iterator = iterator_over(
        chain(X=first, Y=Scripted()), lambda: items.pop(0), loop_outcomes=['done']
    )
    again = Scripted('again', outcomes=('ok', 'again'))
    machine = smach.StateMachine(OUTCOMES)
    machine.userdata.done = []
    with machine:
        smach.StateMachine.add('FIND', Scripted('aborted'), {'ok': 'ALL'})
        smach.StateMachine.add('ALL', iterator, {'done': 'LAST'})
        smach.StateMachine.add('LAST', again, {'ok': 'done', 'again': 'ALL'})
    again.script, again.otherwise = ['again'], 'ok'
    expert = FakeExpert(goto('Y', container='SM_ROOT/ALL/EACH'))
    wrapped = OracleContainer.wrap(machine, expert=expert, settings=ASKS)
    assert (wrapped.execute(), len(expert.questions), first.runs) == ('done', 1, 1)


def test_a_state_to_which_the_oracle_led_before_is_come_to_by_itself_later():
    def takes_long(state, ud):
        assert not threading.Event().wait(0.3)  # six times as long as it takes to ask
        return 'ok'

    expert = FakeExpert(goto('B'), goto('A'))
    machine = asked(
        Scripted('aborted', 'ok'),
        Scripted('aborted', takes_long),
        expert=expert,
        max_recoveries=0,
        still_running_s=0.3,
    )
    assert machine.run() == 'done'
    assert [question.failed_state for question in expert.questions] == ['A', 'B']


def test_a_container_says_in_which_state_it_begins_where_it_was_led_to_one():
    inner = chain(X=Scripted('ok', 'ok'), Y=Scripted())
    expert = FakeExpert(goto('Y', container='SM_ROOT/IN'))
    machine = Watched(chain(IN=inner, END=Scripted('aborted')), expert=expert, settings=ASKS)
    assert machine.run() == 'done'
    begins = [event.state for event in machine.of(EventKind.CONTAINER_START)]
    assert begins == ['IN', 'X', 'Y']


def test_a_visit_that_comes_by_itself_is_asked_about_no_more():
    """The one before was by the oracle. A copy of the userdata is made at each."""

    def takes_long(state, ud):
        assert not threading.Event().wait(0.2)  # four times as long as it takes to ask
        return 'ok'

    expert = FakeExpert(goto('A'))
    state = Scripted('aborted', 'again', takes_long, outcomes=('ok', 'aborted', 'again'))
    bare = chain(A=state)
    bare._transitions['A']['again'] = 'A'
    settings = dict(SOON, max_recoveries=0, deep_copy_keys=['x'])
    machine = Watched(bare, expert=expert, settings=settings)
    assert machine.run() == 'done' and machine.visits() == ['A'] * 3
    assert len(expert.questions) == 1
