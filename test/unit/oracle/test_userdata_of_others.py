"""A jump leaves alone what another part of the program writes into the userdata."""

import pytest
from machines import FakeExpert, Scripted, Watched, chain_of, contents, goto

import smach

INPUT = {'input_keys': ['stop']}


def asks_to_stop(machine, key='stop'):
    """The end of a visit in which a callback of the program has come."""

    def step(state, ud):
        machine.userdata[key] = True
        return 'aborted'

    return step


def sees(ud):
    return ud.stop if 'stop' in ud else 'not there'


def run(machine, drive, seen, **wrap):
    """The program's callback writes in the first visit. What does the next one see?"""
    drive.script += [asks_to_stop(machine), lambda state, ud: seen.append(sees(ud)) or 'ok']
    Watched(machine, **wrap).run()


@pytest.mark.parametrize('begins_with', [{'stop': False}, {}])
def test_a_state_that_is_tried_again_sees_that_it_is_to_stop(begins_with):
    drive, seen = Scripted(**INPUT), []
    machine = chain_of(drive)
    for key, value in begins_with.items():
        machine.userdata[key] = value
    run(machine, drive, seen)
    assert seen == [True] and machine.userdata.stop is True


def test_so_does_a_state_before_it():
    look, drive = Scripted(**INPUT), Scripted(**INPUT)
    machine = chain_of(look, drive)
    machine.userdata.stop = False
    seen = []
    look.script = ['ok', lambda state, ud: seen.append(ud.stop) or 'ok']
    drive.script = [asks_to_stop(machine)]
    Watched(machine, settings={'policy': 'step_back'}).run()
    assert seen == [True]


def test_so_does_the_state_to_which_an_expert_sends_the_machine():
    drive, seen = Scripted(**INPUT), []
    machine = chain_of(drive)
    expert = FakeExpert(goto('A'))
    run(machine, drive, seen, expert=expert, settings={'max_recoveries': 0})
    assert seen == [True]
    assert [each.missing_keys for each in expert.questions[0].choices] == [()]


@pytest.mark.parametrize(
    'other',
    [
        {'state': Scripted(output_keys=['stop'])},
        {'state': Scripted(output_keys=['halt']), 'remapping': {'halt': 'stop'}},
        {'state': Scripted(), 'constants': {'stop': False}},
    ],
)
def test_a_key_that_a_state_may_write_is_put_back(other):
    drive, seen = Scripted(**INPUT), []
    machine = chain_of(drive)
    machine.userdata.stop = False
    with machine:
        add = {key: value for key, value in other.items() if key != 'state'}
        smach.StateMachine.add('OTHER', other['state'], {'ok': 'done'}, **add)
    run(machine, drive, seen)
    assert seen == [False]


def test_a_key_for_a_deep_copy_is_put_back():
    drive, seen = Scripted(**INPUT), []
    machine = chain_of(drive)
    machine.userdata.stop = False
    run(machine, drive, seen, settings={'deep_copy_keys': ['stop']})
    assert seen == [False]


def test_the_state_of_an_iterator_has_all_keys_in_its_hands():
    drive, seen = Scripted(**INPUT), []
    iterator = smach.Iterator(['done', 'aborted'], ['stop'], ['stop'], [1], 'item', 'done')
    with iterator:
        smach.Iterator.set_contained_state('DRIVE', drive, loop_outcomes=['ok'])
    top = smach.StateMachine(['done', 'aborted', 'preempted'])
    top.userdata.stop = False
    with top:
        smach.StateMachine.add('ALL', iterator)
    drive.script += [asks_to_stop(iterator), lambda state, ud: seen.append(ud.stop) or 'ok']
    Watched(top).run()
    assert seen == [False]


def asks_meanwhile(machine):
    """A precondition that is not met, and writes. Meanwhile a callback comes."""

    def look(ud):
        ud.found = 'nothing'
        machine.userdata.stop = True
        return False

    return look


@pytest.mark.parametrize('begins_with', [{'stop': False}, {}])
def test_what_comes_while_an_unmet_precondition_runs_stays(begins_with):
    drive, seen = Scripted('aborted', lambda state, ud: seen.append(sees(ud)) or 'ok', **INPUT), []
    machine = chain_of(drive)
    for key, value in begins_with.items():
        machine.userdata[key] = value
    preconditions = {'A': [asks_meanwhile(machine)]}
    assert Watched(machine, preconditions=preconditions).run() == 'done'
    assert seen == [True]
    assert contents(machine.userdata) == {'stop': True}


def test_what_a_state_within_has_written_as_a_precondition_is_taken_back():
    look = Scripted(asks_to_find, output_keys=['found'])
    machine = chain_of(Scripted('aborted'), look)
    assert Watched(machine, preconditions={'A': ['B']}).run() == 'done'
    assert look.runs == 2 and contents(machine.userdata) == {}


def asks_to_find(state, ud):
    ud.found = 'nothing'
    return 'aborted'


def test_a_restart_leaves_it_too():
    drive, seen = Scripted(**INPUT), []
    machine = chain_of(drive)
    machine.userdata.stop = False
    run(machine, drive, seen, settings={'policy': 'restart'})
    assert seen == [True]
