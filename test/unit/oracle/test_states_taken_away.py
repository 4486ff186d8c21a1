"""The menu of a failure where states of the machine were taken away meanwhile."""

import pytest
from machines import FakeExpert, Scripted, Watched, goto
from reporting_machines import BAD, made, reporting
from test_ways import ENDS, at_once, failing, menu_at

import smach
from smach_oracle.oracle.records.events import EventKind


def taken_away(machine, label):
    for table in (machine._states, machine._transitions):
        del table[label]


@pytest.mark.parametrize('gone', ['', 'OPEN', 'OPEN CLOSE'])
def test_of_a_machine_on_the_way_the_states_that_were_visited_in_it_count(gone):
    def fail(state, ud):
        for label in gone.split():
            taken_away(arm, label)
        return 'aborted'

    arm = smach.StateMachine(outcomes=ENDS)
    with arm:
        smach.StateMachine.add('OPEN', Scripted(), {'ok': 'CLOSE'})
        smach.StateMachine.add('CLOSE', Scripted(), {'ok': 'done'})
        smach.StateMachine.add('STOW', Scripted(), {'ok': 'done'})
    top = smach.StateMachine(outcomes=ENDS)
    with top:
        smach.StateMachine.add('ARM', arm, {'done': 'PICK'})
        smach.StateMachine.add('PICK', Scripted(fail), {'ok': 'done'})
    machine = at_once(Watched(top, settings={'policy': 'escalating'}))
    assert machine.run() == 'done'
    repeated = {'': ['ARM/OPEN', 'ARM/CLOSE'], 'OPEN': ['ARM/CLOSE'], 'OPEN CLOSE': ['ARM']}
    assert list(menu_at(machine)['ARM']['repeats']) == repeated[gone]


def test_what_leads_to_a_state_that_is_gone_does_not_end_the_loop():
    """NEXT, PICK, and again from NEXT, which leads to ASIDE, too, until PICK fails."""

    def fail(state, ud):
        taken_away(top, 'ASIDE')
        return 'aborted'

    top = smach.StateMachine(outcomes=ENDS)
    with top:
        smach.StateMachine.add(
            'NEXT', Scripted(outcomes=('ok', 'aside', 'aborted')), {'ok': 'PICK', 'aside': 'ASIDE'}
        )
        smach.StateMachine.add('PICK', Scripted('ok', fail, 'ok', 'ok'), {'ok': 'MORE'})
        more = Scripted('more', outcomes=('ok', 'more', 'aborted'))
        smach.StateMachine.add('MORE', more, {'more': 'NEXT', 'ok': 'done'})
        smach.StateMachine.add('ASIDE', Scripted(), {'ok': 'MORE'})
    machine = at_once(Watched(top, settings={'policy': 'escalating'}))
    assert machine.run() == 'done'
    assert {way['target'] for way in machine.of(EventKind.DECISION)[0].data['menu']} == {
        'PICK',
        'NEXT',
    }


def test_a_state_that_is_gone_is_on_no_menu_and_not_entered_on_the_way():
    def fail(state, ud):
        taken_away(machine.machine, 'B')
        return 'aborted'

    machine = failing(3, fails=['aborted', fail], expert=FakeExpert())
    assert machine.run() == 'done'
    assert [key for key in menu_at(machine, 0) if isinstance(key, str)] == ['B', 'A']
    assert [key for key in menu_at(machine, 1) if isinstance(key, str)] == ['A']
    assert list(menu_at(machine, 1)['A']['repeats']) == ['A']


def test_a_failure_is_reported_though_a_state_in_between_is_gone():
    expert = FakeExpert(goto('CALL'), goto('WORK'))

    def tells(state, ud):
        taken_away(machine.machine, 'CALL')
        return 'said'

    machine = reporting(
        Scripted('failed', outcomes=BAD),
        Scripted(tells, outcomes=('said',)),
        between=[
            (
                'STOW',
                Scripted('aborted', outcomes=('stowed', 'aborted')),
                {'stowed': 'REPORT', 'aborted': 'failed'},
            ),
            ('CALL', Scripted(outcomes=('called',)), {'called': 'REPORT'}),
        ],
        expert=expert,
        settings={'max_recoveries': 0},
    )
    assert machine.run() == 'done'
    assert machine.visits() == ['LOOK', 'WORK', 'STOW', 'CALL', 'REPORT', 'WORK']
    assert [question.failed_state for question in expert.questions] == ['STOW', 'WORK']


def test_the_listing_goes_back_to_the_latest_state_that_is_left():
    def tell(state, ud):
        if 'LOOK' in machine.machine.get_children():
            taken_away(machine.machine, 'LOOK')
        return 'said'

    home = 'HOME', Scripted('seen', outcomes=('past', 'seen')), {'seen': 'LOOK', 'past': 'WORK'}
    look = 'LOOK', Scripted(outcomes=('seen',)), {'seen': 'WORK'}
    work = 'WORK', Scripted('failed', outcomes=BAD), {'ok': 'done', 'failed': 'REPORT'}
    report = 'REPORT', Scripted(tell, outcomes=('said',)), {'said': 'failed'}
    machine = Watched(made([home, look, work, report]), settings={'policy': 'algorithm1'})
    assert machine.run() == 'done'
    assert machine.of(EventKind.JUMP)[0].target == 'HOME'
