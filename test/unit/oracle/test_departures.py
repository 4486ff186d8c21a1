"""Containers that are left for a level above, also where another branch has left them before."""

import os

import pytest
from guarded_machines import both, chain
from machines import FakeExpert, Gate, Scripted, Watched, give_up, goto
from test_preempt_and_shutdown import NotesOnly

import smach
from smach_oracle.oracle.records.events import EventKind

UPSTREAM = bool(os.environ.get('SMACH_UPSTREAM'))


class Obeys:
    """A state that obeys the preempt of the first departure. Its author goes on, though."""

    def __init__(self):
        self.gate = Gate()

    def __call__(self, state, ud):
        assert self.gate(state, ud) == 'preempted'
        return 'ok'


def leave(right, *obeying):
    """L goes to C once all that obey have begun. Whatever fails in RIGHT is sent to A, too late."""

    def fails(state, ud):
        assert all(each.gate.entered.wait(20) for each in obeying)
        return 'aborted'

    class Expert(FakeExpert):
        def ask(self, question, cancelled, progress):
            return goto('C' if question.failed_state == 'L' else 'A', container='TOP')

    machine = chain(
        A=Scripted(), BOTH=both(LEFT=chain(L=Scripted(fails)), RIGHT=right), C=Scripted()
    )
    watched = Watched(machine, name='TOP', expert=Expert(), settings={'max_recoveries': 0})
    assert watched.run() == 'done'
    assert [event.target for event in watched.of(EventKind.JUMP)] == ['C']
    return watched


def preempts(watched):
    return sorted((event.path, event.state) for event in watched.of(EventKind.PREEMPT))


@pytest.mark.skipif(UPSTREAM, reason='its Concurrence hands on one preempt in an execution')
def test_what_has_gone_on_in_the_branch_is_preempted_again():
    """RIGHT was preempted already, and what runs in it has obeyed."""
    one, other, beside = Obeys(), Obeys(), Gate()

    def fails(state, ud):
        assert beside.entered.wait(20)
        return 'aborted'

    watched = leave(
        both(
            ONE=chain(OBEYS=Scripted(one), R=Scripted(fails)),
            OTHER=chain(OBEYS=Scripted(other), S=Scripted(beside)),
        ),
        one,
        other,
    )
    ends = {event.path: event.outcome for event in watched.of(EventKind.CONTAINER_END)}
    assert ends['TOP/BOTH/RIGHT/OTHER'] == 'preempted'
    assert preempts(watched) == [
        ('TOP/BOTH/RIGHT/ONE', 'OBEYS'),
        ('TOP/BOTH/RIGHT/ONE', 'ORACLE'),
        ('TOP/BOTH/RIGHT/OTHER', 'OBEYS'),
        ('TOP/BOTH/RIGHT/OTHER', 'S'),
    ]


def test_a_machine_that_fails_itself_gets_no_further_preempt():
    one = Obeys()
    watched = leave(chain(OBEYS=Scripted(one), R=Scripted('aborted')), one)
    assert preempts(watched) == [('TOP/BOTH/RIGHT', 'OBEYS')]


def test_a_machine_around_what_fails_is_preempted():
    """It has gone on behind a preempt, and would go on behind this end as well."""
    one = Obeys()
    watched = leave(
        chain(OBEYS=Scripted(one), IN=chain(R=Scripted('aborted')), LAST=Scripted()), one
    )
    assert 'LAST' not in watched.visits()
    ends = {event.path: event.outcome for event in watched.of(EventKind.CONTAINER_END)}
    assert ends['TOP/BOTH/RIGHT'] == 'preempted'


@pytest.mark.parametrize(
    'answer, told',
    [
        (goto('A', container='TOP'), 'TOP/PICK is left for TOP/A'),
        (give_up('done', container='TOP/PICK'), 'TOP/PICK/ARM is left for its end with done'),
    ],
    ids=['goto', 'give up'],
)
def test_the_log_says_for_what_a_container_is_left(answer, told, log):
    machine = chain(A=Scripted(), PICK=chain(ARM=chain(GRASP=Scripted('aborted'))))
    expert = FakeExpert(answer)
    watched = Watched(machine, name='TOP', expert=expert, settings={'max_recoveries': 0})
    assert watched.run() == 'done'
    assert [text for _, text in log if ' is left for ' in text] == [told]


def test_a_container_that_is_left_goes_no_way_that_it_went_before_with_the_same_outcome():
    """It has no other one."""
    pick = smach.StateMachine(outcomes=['done'])
    with pick:
        grasp = Scripted('ok', RuntimeError('slipped'), outcomes=('ok',))
        smach.StateMachine.add('GRASP', grasp, {'ok': 'done'})
    machine = smach.StateMachine(outcomes=['done', 'aborted'])
    with machine:
        smach.StateMachine.add('A', Scripted(outcomes=('ok',)), {'ok': 'PICK'})
        smach.StateMachine.add('PICK', pick, {'done': 'CHECK'})
        check = Scripted('again', 'ok', outcomes=('ok', 'again'))
        smach.StateMachine.add('CHECK', check, {'ok': 'done', 'again': 'PICK'})
    expert = FakeExpert(goto('A', container='TOP'))
    watched = Watched(machine, name='TOP', expert=expert, settings={'max_recoveries': 0})
    assert watched.run() == 'done'
    assert [label for label in watched.visits() if label != 'GRASP'] == [
        *('A', 'PICK', 'CHECK', 'PICK'),
        *('A', 'PICK', 'CHECK'),
    ]


@pytest.mark.parametrize(
    'outcomes, fails, left_with',
    [
        (['done', 'aborted', 'preempted'], 'aborted', 'preempted'),
        (['done', 'aborted', 'failed'], 'failed', 'failed'),
        (['a_good_one', 'done', 'failed'], ValueError('slipped'), 'failed'),
        (['a_good_one', 'done'], ValueError('slipped'), 'a_good_one'),
    ],
)
def test_a_container_that_is_left_ends_with_the_outcome_that_says_least(outcomes, fails, left_with):
    arm, top, told = smach.StateMachine(outcomes), smach.StateMachine(outcomes), []
    failing = [each for each in outcomes if each not in ('a_good_one', 'done')]
    with arm:
        smach.StateMachine.add('GRASP', Scripted(fails, outcomes=['ok', *failing]), {'ok': 'done'})
    arm.register_termination_cb(lambda ud, active, outcome: told.append(outcome))
    with top:
        smach.StateMachine.add('LOOK', Scripted(outcomes=['ok']), {'ok': 'ARM'})
        smach.StateMachine.add('ARM', arm)
    answers = goto('LOOK', container='TOP')
    machine = Watched(top, name='TOP', expert=FakeExpert(answers), settings={'max_recoveries': 0})
    assert machine.run() == 'done'
    assert told == [left_with, 'done']


class Clears(smach.StateMachine):
    """Raises after its first execution."""

    def execute(self, parent_ud=None):
        outcome = super().execute(parent_ud)
        if not hasattr(self, 'has_raised'):
            self.has_raised = True
            raise ValueError('cannot clear')
        return outcome


def test_a_container_that_raises_as_it_is_left_counts_as_left():
    arm = Clears(outcomes=['done', 'aborted'])
    with arm:
        smach.StateMachine.add('GRASP', Scripted('aborted'), {'ok': 'done', 'preempted': 'aborted'})
    expert = FakeExpert(goto('A', container='TOP'))
    machine = chain(A=Scripted(), ARM=arm)
    watched = Watched(machine, name='TOP', expert=expert, settings={'max_recoveries': 0})
    assert watched.run() == 'done'
    counted = {
        (row.state, row.outcome, row.to): row.count for row in watched.machine.transition_counts()
    }
    assert counted['ARM', 'left', 'ORACLE'] == 1


class Keeps(Clears):
    """Leaves its preempt to whoever has asked for it."""

    def service_preempt(self):
        pass


def test_what_a_container_raises_as_it_is_left_is_told_and_its_preempt_taken_back(log):
    arm = Keeps(outcomes=['done', 'aborted'])
    with arm:
        smach.StateMachine.add('GRASP', Scripted('aborted'), {'ok': 'done', 'preempted': 'aborted'})
    expert = FakeExpert(goto('A', container='TOP'))
    seen = []
    looks = Scripted('ok', lambda state, ud: seen.append(arm.preempt_requested()) or 'ok')
    machine = chain(A=looks, ARM=arm)
    watched = Watched(machine, name='TOP', expert=expert, settings={'max_recoveries': 0})
    assert watched.run() == 'done' and seen == [False]
    assert ('warn', "TOP/ARM: raised ValueError('cannot clear') when it was left") in log


@pytest.mark.parametrize('kind', [smach.StateMachine, NotesOnly])
def test_a_container_has_serviced_its_preempt_as_it_ends_for_being_left(kind):
    arm, seen = kind(['done', 'aborted']), []
    with arm:
        smach.StateMachine.add('GRASP', Scripted('aborted'), {'ok': 'done', 'preempted': 'aborted'})
    arm.register_termination_cb(lambda *_: seen.append(arm.preempt_requested()))
    expert = FakeExpert(goto('A', container='TOP'))
    machine = chain(A=Scripted(), ARM=arm)
    watched = Watched(machine, name='TOP', expert=expert, settings={'max_recoveries': 0})
    assert watched.run() == 'done' and seen == [False, False]


class Twice(smach.StateMachine):
    """Does all its work twice."""

    def execute(self, parent_ud=None):
        super().execute(parent_ud)
        return super().execute(parent_ud)


def test_a_machine_that_begins_once_more_forgets_where_it_was_led_and_what_it_had_then():
    seen, numbers = [], iter(range(9))

    def counts(state, ud):
        ud.x = number = next(numbers)
        return 'aborted' if number == 2 else 'ok'

    def notes(state, ud):
        seen.append(ud.x)
        return 'ok'

    inner = Twice(['done', 'aborted', 'preempted'])
    with inner:
        smach.StateMachine.add('A', Scripted(*[counts] * 9, output_keys=['x']), {'ok': 'B'})
        smach.StateMachine.add('B', Scripted(*[notes] * 9, input_keys=['x']), {'ok': 'done'})
    watched = Watched(
        chain(IN=inner, LAST=Scripted('aborted')),
        name='TOP',
        expert=FakeExpert(goto('B', container='TOP/IN'), goto('B')),
        settings={'max_recoveries': 0},
    )
    assert watched.run() == 'done'
    once, again = ['IN', 'A', 'B', 'A', 'B', 'LAST'], ['IN', 'B', 'A', 'B', 'LAST']
    assert watched.visits() == once + again and seen == [0, 1, 1, 2]
