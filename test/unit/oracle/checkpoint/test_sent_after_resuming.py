"""A resumed machine that is held before it goes on, and sent elsewhere by an operator."""

from held_machines import Held
from killed_machines import Diary, Noted, Points, in_a_process
from killed_trees import ENDS
from left_stores import Left

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


def sent_to_the_first(killed, build):
    """What a resumed machine does that waits before ALL, is sent to FIRST, and goes to the end."""

    def work():
        machine = first_and_all(build)(Diary(killed.diary._path), Points(0))
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
            held.hand.go_to('TOP', 'FIRST')
            held.waits_before('TOP/ALL')
            held.hand.confirm()
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
