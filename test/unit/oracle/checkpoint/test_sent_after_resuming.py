"""A resumed machine that is held before it goes on, and sent elsewhere by an operator."""

import os
import signal
import threading

from held_machines import Held, eventually
from killed_machines import Diary, KilledMachine, Noted, Points, in_a_process
from killed_trees import ENDS
from left_stores import Left
from machines import Scripted

import smach
from smach_oracle.oracle.records.events import EventKind

HELD = {'ALL': {'autonomy': 'confirm'}}


def first_and_all(build):
    def machine(diary, points):
        top = smach.StateMachine(['succeeded', 'aborted'])
        top.userdata.done = []
        with top:
            smach.StateMachine.add('FIRST', Noted('FIRST', diary, points), {'succeeded': 'ALL'})
            smach.StateMachine.add('ALL', build(diary, points), ENDS)
        return top

    return machine


def iterator(diary, points):
    items = smach.Iterator(
        ['succeeded', 'aborted'],
        ['done'],
        ['done'],
        it=range(3),
        it_label='item',
        exhausted_outcome='succeeded',
    )
    with items:
        smach.Iterator.set_contained_state(
            'I', Noted('I', diary, points, keys=('done', 'item')), loop_outcomes=['succeeded']
        )
    return items


def nested(diary, points):
    inner = smach.StateMachine(['succeeded', 'aborted'], ['done'], ['done'])
    with inner:
        for name, following in (('I0', 'I1'), ('I1', 'I2'), ('I2', 'succeeded')):
            smach.StateMachine.add(name, Noted(name, diary, points), {'succeeded': following})
    return inner


def send_to_the_first(held):
    held.hand.go_to('TOP', 'FIRST')
    held.waits_before('TOP/ALL')
    held.hand.confirm()


def sent_to_the_first(killed, build):
    """What a resumed machine does that waits before ALL, is sent to FIRST, and goes to the end."""
    return after(send_to_the_first, killed, first_and_all(build))


def after(command, killed, build):
    """What a resumed machine does that waits before ALL, and goes to the end after a command."""

    def work():
        machine = build(Diary(killed.diary._path), Points(0))
        held = Held(
            machine,
            name='TOP',
            settings={
                'checkpoint': killed.store,
                'checkpoint_synchronous': 'OFF',
                'on_resume': 'recover',
                'checkpoint_wait_s': 60,
                'states': HELD,
            },
        )
        with held.begin():
            held.waits_before('TOP/ALL')
            command(held)
            outcome = held.end()
        return {
            'outcome': outcome,
            'done': machine.userdata.done,
            'failures': [event.state for event in held.of(EventKind.FAILURE)],
        }

    return in_a_process(work)


def check_begins_anew(tmp_path, build):
    left = Left(first_and_all(build))
    killed = left.killed_at(left.first_in('I1'), tmp_path / 'killed')  # the second of three
    assert killed.diary.count('ends')['I0'] == 1
    told = sent_to_the_first(killed, build)
    assert (told['outcome'], told['failures']) == ('succeeded', [])
    # the userdata are those with which FIRST began
    assert told['done'] == ['FIRST', 'I0', 'I1', 'I2']
    assert killed.diary.count('ends')['I0'] == 2, 'it does not go on behind it'


def test_an_iterator_begins_with_its_first_item(tmp_path):
    check_begins_anew(tmp_path, iterator)


def test_a_nested_machine_begins_with_its_first_state(tmp_path):
    check_begins_anew(tmp_path, nested)


def concurrent(diary, points):
    """LEFT, a machine of one state, and RIGHT, which is killed behind its end once."""
    has_ended = threading.Event()

    def note_end(outcomes):
        has_ended.set()
        return False

    def right(state, userdata):
        assert has_ended.wait(20)
        if diary.count('begins')['LEFT'] == 1:
            os.kill(os.getpid(), signal.SIGKILL)
        return 'succeeded'

    left = smach.StateMachine(['succeeded', 'aborted'], ['done'], ['done'])
    with left:
        smach.StateMachine.add('L', Noted('LEFT', diary, points))
    both = smach.Concurrence(
        ['succeeded', 'aborted'],
        default_outcome='aborted',
        input_keys=['done'],
        output_keys=['done'],
        outcome_map={'succeeded': {'LEFT': 'succeeded', 'RIGHT': 'succeeded'}},
        child_termination_cb=note_end,
    )
    with both:
        smach.Concurrence.add('LEFT', left)
        smach.Concurrence.add('RIGHT', Scripted(right, outcomes=('succeeded', 'aborted')))
    return both


def test_a_machine_that_had_ended_in_a_concurrence_begins_again(tmp_path):
    killed = KilledMachine(tmp_path, first_and_all(concurrent))
    assert killed.run() is None
    told = sent_to_the_first(killed, concurrent)
    assert (told['outcome'], told['done']) == ('succeeded', ['FIRST', 'LEFT'])
    assert killed.diary.count('begins') == {'FIRST': 2, 'LEFT': 2}


def cleaned_and_all(diary, points):
    """ALL, which leads to CLEAN at a preempt, and that back to ALL."""
    inner = nested(diary, points)
    inner.register_outcomes(['preempted'])
    inner['I0'].register_outcomes(['preempted'])
    inner._transitions['I0']['preempted'] = 'I1'
    clean = Scripted(lambda state, userdata: state.service_preempt() or 'ok')
    top = smach.StateMachine(['succeeded', 'aborted'])
    top.userdata.done = []
    with top:
        smach.StateMachine.add('ALL', inner, dict(ENDS, preempted='CLEAN'))
        smach.StateMachine.add('CLEAN', clean, dict.fromkeys(['ok', 'aborted', 'preempted'], 'ALL'))
    return top


def preempt(held):
    held.machine.request_preempt()
    eventually(lambda: 'CLEAN' in held.visits())
    held.waits_before('TOP/ALL')
    held.hand.confirm()


def test_a_machine_that_is_passed_by_at_a_preempt_begins_with_its_first_state(tmp_path):
    left = Left(cleaned_and_all)
    killed = left.killed_at(left.first_in('I1'), tmp_path / 'killed')
    told = after(preempt, killed, cleaned_and_all)
    assert (told['outcome'], told['failures']) == ('succeeded', [])
    assert killed.diary.count('ends') == {'I0': 2, 'I1': 1, 'I2': 1}
