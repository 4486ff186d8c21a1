"""Failures that experts take back, or that come in between, before a later state reports one."""

import pytest
from machines import FakeExpert, Scripted, Watched, supersede
from reporting_machines import BAD, made, reporting

from smach_oracle.oracle.machine.tree_node import marked_node
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.oracle.records.visits import Visit, VisitResult
from smach_oracle.oracle.recovery.failure import _context_then


@pytest.mark.parametrize('superseded', [1, 2])
def test_a_failure_that_an_expert_takes_back_meanwhile_makes_no_other_one_continuous(superseded):
    """WORK has failed once. It is MODERATE, of which the policy asks where that is continuous."""
    stows = [
        ('STOW{}'.format(number), Scripted('failed', outcomes=('stowed', 'failed')))
        for number in range(superseded)
    ]
    after = [label for label, _ in stows[1:]] + ['REPORT']
    machine = reporting(
        Scripted('failed', outcomes=BAD),
        between=[
            (label, state, {'stowed': target}) for (label, state), target in zip(stows, after)
        ],
        expert=FakeExpert(*[supersede('stowed')] * superseded),
        settings={
            'policy': 'algorithm1',
            'states': {'WORK': {'prior': 0.5}, 'STOW*': {'max_recoveries': 0}},
        },
    )
    assert machine.run() == 'done'
    assert machine.decisions() == [('ask', '')] * superseded + [('step_back', 'LOOK')]
    assert [event.continuous for event in machine.of(EventKind.DECISION)][-1] is False


def test_failures_that_experts_take_back_one_after_the_other_are_all_forgotten():
    """REPORT reports SECOND, and FIRST once an expert has done the work of that."""
    ends = {'said': 'failed', 'end': 'done'}
    states = [
        ('LOOK', Scripted(outcomes=('seen',)), {'seen': 'FIRST'}),
        ('FIRST', Scripted('failed', outcomes=BAD), {'ok': 'SECOND', 'failed': 'SECOND'}),
        ('SECOND', Scripted('failed', outcomes=BAD), {'ok': 'REPORT', 'failed': 'REPORT'}),
        ('REPORT', Scripted('said', 'said', 'end', outcomes=('said', 'end')), ends),
    ]
    machine = Watched(
        made(states),
        expert=FakeExpert(supersede('ok')),
        settings={
            'policy': 'algorithm1',
            'states': {'FIRST': {'prior': 0.5}, 'SECOND': {'max_recoveries': 0}},
        },
    )
    assert machine.run() == 'done'
    assert machine.decisions() == [('ask', ''), ('step_back', 'LOOK')]


def test_another_failure_meanwhile_moves_no_goal_of_a_state_that_keeps_failing():
    """WORK has failed twice. DRIVE has succeeded in between, after LOOK, which the goal is."""
    work = Scripted(RuntimeError('jammed'), 'failed', outcomes=BAD)
    stow = Scripted('failed', outcomes=('stowed', 'failed'))
    machine = Watched(
        made(
            [
                (
                    'LOOK',
                    Scripted('seen', 'far', outcomes=('seen', 'far')),
                    {'seen': 'WORK', 'far': 'DRIVE'},
                ),
                ('DRIVE', Scripted(outcomes=('there',)), {'there': 'WORK'}),
                ('WORK', work, {'ok': 'done', 'failed': 'STOW'}),
                ('STOW', stow, {'stowed': 'REPORT', 'failed': 'STOW'}),
                ('REPORT', Scripted(outcomes=('said',)), {'said': 'failed'}),
            ]
        ),
        preconditions={'WORK': [lambda ud: False]},
        settings={'memory': 100, 'policy': 'prose'},
    )
    assert machine.run() == 'done'
    assert machine.decisions() == [('step_back', 'LOOK')] * 2


def test_a_superseded_state_is_the_latest_one_before_the_next():
    states = [
        ('WORK', Scripted('failed', outcomes=BAD), {'ok': 'PLACE', 'failed': 'REPORT'}),
        ('REPORT', Scripted(outcomes=('said',)), {'said': 'failed'}),
        ('PLACE', Scripted('failed', outcomes=BAD), {'ok': 'done', 'failed': 'failed'}),
    ]
    machine = Watched(
        made(states),
        expert=FakeExpert(supersede('ok')),
        settings={'policy': 'algorithm1', 'states': {'WORK': {'max_recoveries': 0}}},
    )
    assert machine.run() == 'done'
    assert machine.decisions() == [('ask', ''), ('step_back', 'WORK')]


def test_of_a_failure_that_is_forgotten_the_visits_say_what_came_before():
    """Ten failures are remembered. The visits of the chain may go back farther."""
    machine = reporting(Scripted('failed', outcomes=BAD)).machine
    node = marked_node(machine)
    before = (
        Visit('REPORT', 'said', VisitResult.SUCCESS),
        Visit('LOOK', 'seen', VisitResult.SUCCESS),
        Visit('WORK', 'ok', VisitResult.SUCCESS),
        Visit('REPORT', 'failed', VisitResult.FAILURE),
    )
    record = node.record('WORK')
    assert _context_then(node, record, before).succeeded_before == 'LOOK'
    assert _context_then(node, record, before[2:]).succeeded_before is None
    assert _context_then(node, record, before).unconditioned == 'REPORT'


def test_nothing_is_reported_where_a_stop_was_obeyed():
    """The author goes on from the stop, and ends with what would report the failure of WORK."""

    def obeys(state, ud):
        machine.machine.request_preempt()
        state.service_preempt()
        return 'preempted'

    call = Scripted(obeys, outcomes=('called', 'preempted'))
    stow = Scripted(outcomes=('stowed', 'preempted'))
    machine = reporting(
        Scripted('failed', outcomes=BAD),
        between=[
            ('CALL', call, {'called': 'STOW', 'preempted': 'STOW'}),
            ('STOW', stow, {'stowed': 'REPORT', 'preempted': 'REPORT'}),
        ],
    )
    assert machine.run() == 'failed'
    assert machine.visits() == ['LOOK', 'WORK', 'CALL', 'STOW', 'REPORT']
    assert not machine.of(EventKind.DECISION)


def test_a_failure_that_keeps_coming_is_continuous_after_that_of_another_state():
    machine = Watched(
        made(
            [
                ('LOOK', Scripted('failed', outcomes=('seen', 'failed')), {'seen': 'WORK'}),
                (
                    'WORK',
                    Scripted('failed', 'failed', outcomes=BAD),
                    {'ok': 'done', 'failed': 'REPORT'},
                ),
                ('REPORT', Scripted(outcomes=('said',)), {'said': 'failed'}),
            ]
        ),
        settings={'memory': 100},
    )
    assert machine.run() == 'done'
    assert [event.continuous for event in machine.of(EventKind.DECISION)] == [False, False, True]


def test_a_state_reports_a_failure_also_where_its_own_states_went_on_without_the_oracle():
    within = made(
        [
            ('TALK', Scripted('failed', 'failed', outcomes=BAD), {'ok': 'done', 'failed': 'SIGN'}),
            ('SIGN', Scripted(outcomes=('ok',)), {'ok': 'done'}),
        ]
    )
    within.otherwise = 'done'  # as that of a Scripted: what REPORT ends with
    states = {'TALK': {'author_recoveries': 'override', 'max_recoveries': 0}}
    machine = reporting(
        Scripted('failed', outcomes=BAD),
        within,
        settings={'states': states, 'policy': 'escalating'},
    )
    assert machine.run() == 'done'
    (given_up,) = machine.of(EventKind.GIVE_UP)
    assert (given_up.state, given_up.target) == ('TALK', 'SIGN')
    assert machine.visits() == ['LOOK', 'WORK', 'REPORT', 'TALK', 'SIGN', 'WORK']
