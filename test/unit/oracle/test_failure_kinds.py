"""What counts as a failure, and what ends as it did without an oracle."""

import pytest
from guarded_machines import OUTCOMES, both, chain
from machines import FakeExpert, Gate, Scripted, Watched, chain_of, supersede, watched

import smach
from smach_oracle.oracle import oracle_of
from smach_oracle.oracle.machine.site import Route, route_of
from smach_oracle.oracle.records.events import EventKind, FailureKind


def kinds_of(machine):
    return [FailureKind(event.failure_kind) for event in machine.of(EventKind.FAILURE)]


def test_a_machine_without_failures_goes_the_way_its_author_drew():
    machine = watched(Scripted(), Scripted(), Scripted())
    assert machine.run() == 'done'
    assert machine.visits() == ['A', 'B', 'C']
    assert not machine.of(EventKind.FAILURE, EventKind.DECISION, EventKind.JUMP)


def test_an_outcome_that_would_abort_the_machine_is_recovered_from():
    machine = watched(Scripted(), Scripted('aborted'), Scripted())
    assert machine.run() == 'done'
    assert machine.visits() == ['A', 'B', 'B', 'C']
    assert kinds_of(machine) == [FailureKind.FELL_THROUGH]


def test_an_exception_is_recovered_from():
    machine = watched(Scripted(), Scripted(ValueError('no grasp')))
    assert machine.run() == 'done'
    assert kinds_of(machine) == [FailureKind.EXCEPTION]
    assert machine.of(EventKind.FAILURE)[0].text == 'ValueError: no grasp'


def test_what_a_state_has_raised_is_logged_with_its_traceback(log):
    assert watched(Scripted(ValueError('no grasp'))).run() == 'done'
    (told,) = [text for _, text in log if text.startswith('SM_ROOT/A failed: ')]
    assert 'in execute' in told and told.rstrip().endswith('ValueError: no grasp')


@pytest.mark.parametrize('end', [ValueError('no grasp'), SystemExit()])
def test_what_ends_without_an_outcome_has_an_empty_one(end):
    machine = Watched(chain(A=chain(B=Scripted(end))), settings={'max_recoveries': 0})
    with pytest.raises((smach.InvalidUserCodeError, SystemExit)):
        machine.run()
    assert [event.outcome for event in machine.of(EventKind.CONTAINER_END)] == ['', '']


def test_where_nothing_more_can_be_said_of_a_failure_the_log_says_why(log):
    machine = watched(Scripted('aborted'))

    def describe(state):
        raise OSError('no link')

    oracle_of(machine.machine).describe_failure = describe
    assert machine.run() == 'done' and machine.of(EventKind.FAILURE)[0].text == ''
    assert ('warn', "SM_ROOT/A: cannot say more of its failure: OSError('no link')") in log


@pytest.mark.parametrize(
    'end, said',
    [
        ('aborted', 'aborted'),
        (None, "State 'A' of type"),
        ('', "State 'A' of type"),
        (Gate(), 'overran its time limit of 0.05 s'),
    ],
)
def test_the_log_says_in_one_line_what_went_wrong(end, said, log):
    machine = watched(Scripted(end), settings={'time_limit_s': 0.05 if callable(end) else None})
    machine.run()
    line = next(text for level, text in log if level == 'warn')
    assert line.startswith('SM_ROOT/A failed: ' + said)


def test_the_log_says_so_of_a_branch_without_an_outcome_too(log):
    machine = Watched(chain(BOTH=both(LEFT=Scripted('', 'done', outcomes=OUTCOMES))))
    assert machine.run() == 'done'
    assert [text[:37] for level, text in log if level == 'warn'] == [
        "SM_ROOT/BOTH/LEFT failed: State 'LEFT"
    ]


@pytest.mark.parametrize('nonsense', [None, 'no such outcome', 7, ['ok'], {}])
def test_an_unregistered_outcome_is_recovered_from(nonsense):
    machine = watched(Scripted(nonsense), Scripted())
    assert machine.run() == 'done'
    assert kinds_of(machine) == [FailureKind.UNREGISTERED_OUTCOME]


def test_an_outcome_registered_too_late_to_lead_anywhere_is_recovered_from():
    state = Scripted('late')
    machine = watched(state, Scripted())
    state.register_outcomes(['late'])
    assert machine.run() == 'done'
    assert kinds_of(machine) == [FailureKind.UNREGISTERED_OUTCOME]


def test_an_outcome_that_leads_to_what_is_not_there_leads_nowhere():
    machine = smach.StateMachine(['done'])
    with machine:
        smach.StateMachine.add('A', Scripted(), {'ok': 'GONE'})
    assert route_of(machine, 'A', 'ok') == Route('', False)


def test_a_listed_outcome_is_a_failure_though_it_would_end_the_machine_well():
    machine = Watched(
        chain_of(Scripted('empty', outcomes=('ok', 'empty')), outcomes=('done', 'empty')),
        settings={'states': {'A': {'failure_outcomes': ['empty']}}},
    )
    assert machine.run() == 'done'
    assert kinds_of(machine) == [FailureKind.FAILING_OUTCOME]


def test_an_outcome_listed_for_the_whole_machine_is_a_failure_of_every_state():
    machine = Watched(
        chain_of(
            Scripted('empty', outcomes=('ok', 'empty')),
            Scripted('empty', outcomes=('ok', 'empty')),
            outcomes=('done', 'empty'),
        ),
        settings={'failure_outcomes': ['empty']},
    )
    assert machine.run() == 'done'
    assert [event.state for event in machine.of(EventKind.FAILURE)] == ['A', 'B']


def test_preempted_is_never_a_failure():
    machine = watched(Scripted('preempted'))
    assert machine.run() == 'preempted'
    assert not machine.of(EventKind.FAILURE)
    assert (machine.rate('A').successes, machine.rate('A').failures) == (0, 0)


def author_recovers(settings=None):
    machine = smach.StateMachine(outcomes=['done', 'aborted'])
    with machine:
        smach.StateMachine.add(
            'PICK', Scripted('aborted'), {'ok': 'done', 'aborted': 'RESET', 'preempted': 'aborted'}
        )
        smach.StateMachine.add('RESET', Scripted(outcomes=('ok',)), {'ok': 'PICK'})
    return Watched(machine, settings=settings)


def test_the_authors_own_recovery_stays_and_counts_in_the_rate():
    machine = author_recovers()
    assert machine.run() == 'done'
    assert machine.visits() == ['PICK', 'RESET', 'PICK']
    assert not machine.of(EventKind.DECISION)
    assert (machine.rate('PICK').failures, machine.rate('PICK').successes) == (1, 1)
    assert machine.rate('PICK').recoveries == 0


@pytest.mark.parametrize(
    'settings',
    [{'author_recoveries': 'override'}, {'states': {'PICK': {'author_recoveries': 'override'}}}],
)
def test_the_authors_recovery_is_overridden_where_told(settings):
    machine = author_recovers(settings)
    assert machine.run() == 'done'
    assert machine.visits() == ['PICK', 'PICK']
    assert machine.decisions() == [('revisit', 'PICK')]


def test_an_overridden_recovery_is_where_the_machine_goes_when_the_oracle_gives_up():
    machine = author_recovers({'author_recoveries': 'override', 'max_recoveries': 0})
    assert machine.run() == 'done'
    assert machine.visits() == ['PICK', 'RESET', 'PICK']
    assert machine.of(EventKind.GIVE_UP)[0].target == 'RESET'


def test_a_listed_failure_with_a_transition_to_another_state_stays_with_its_author():
    machine = author_recovers({'states': {'PICK': {'failure_outcomes': ['aborted']}}})
    machine.run()
    assert machine.visits() == ['PICK', 'RESET', 'PICK']


def test_other_failing_outcomes_of_the_machine_can_be_named():
    machine = Watched(
        chain_of(Scripted('lost', outcomes=('ok', 'lost')), outcomes=('done', 'lost')),
        settings={'failing_outcomes': ['lost']},
    )
    assert machine.run() == 'done'
    assert kinds_of(machine) == [FailureKind.FELL_THROUGH]


def test_without_recovery_a_failure_is_counted_and_ends_the_machine_as_ever():
    machine = watched(Scripted(), Scripted('aborted'), recover=False)
    assert machine.run() == 'aborted'
    assert machine.rate('B').failures == 1
    assert 'ORACLE' not in machine.machine.get_children()
    assert not machine.of(EventKind.DECISION, EventKind.JUMP)
    assert machine.of(EventKind.TRIAL_START)[0].data['recovers'] is False


def test_when_the_oracle_gives_up_on_an_exception_the_machine_raises_as_ever():
    machine = watched(Scripted(ValueError('no grasp')), settings={'max_recoveries': 0})
    with pytest.raises(
        smach.InvalidUserCodeError, match=r"(?s)Could not execute state 'A'.*Traceback.*no grasp"
    ):
        machine.run()
    assert machine.machine.is_running() is False
    assert [event.kind for event in machine.events[-3:]] == [
        EventKind.GIVE_UP,
        EventKind.CONTAINER_END,
        EventKind.TRIAL_END,
    ]
    assert 'no grasp' in machine.events[-1].text


def test_an_error_of_user_code_from_below_is_raised_as_it_is():
    error = smach.InvalidUserCodeError('from below')
    machine = watched(Scripted(error), settings={'max_recoveries': 0})
    with pytest.raises(smach.InvalidUserCodeError) as raised:
        machine.run()
    assert raised.value is error


def test_when_the_oracle_gives_up_on_an_unregistered_outcome_the_machine_raises_as_ever():
    machine = watched(Scripted('nonsense'), settings={'max_recoveries': 0})
    with pytest.raises(smach.InvalidTransitionError, match='nonsense'):
        machine.run()
    assert machine.machine.is_running() is False
    assert machine.machine.execute() == 'done'


def test_an_inconsistent_machine_still_returns_none(log):
    machine = smach.StateMachine(outcomes=['done'])
    with machine:
        smach.StateMachine.add('A', Scripted(), {'ok': 'NOWHERE'})
    wrapped = Watched(machine)
    assert wrapped.run() is None
    assert wrapped.machine.is_running() is False
    assert any(level == 'err' for level, _ in log)
    assert wrapped.kinds() == ['TRIAL_START', 'CONTAINER_START', 'CONTAINER_END', 'TRIAL_END']


@pytest.mark.parametrize('stop', [KeyboardInterrupt, SystemExit])
def test_ctrl_c_passes_through_and_leaves_the_machine_not_running(stop):
    machine = watched(Scripted(), Scripted(stop()))
    with pytest.raises(stop):
        machine.run()
    assert machine.machine.is_running() is False
    assert not machine.of(EventKind.FAILURE)
    assert machine.run() == 'done'


def test_a_superseding_expert_sees_the_kind_and_the_text():
    expert = FakeExpert(supersede('ok'))
    machine = watched(Scripted(OSError('gone')), expert=expert, settings={'max_recoveries': 0})
    assert machine.run() == 'done'
    assert expert.questions[0].failure_kind is FailureKind.EXCEPTION
    assert expert.questions[0].text == 'OSError: gone'


def test_what_a_state_says_of_its_failing_outcome_is_told(log):
    expert = FakeExpert(supersede('ok'))
    machine = watched(Scripted('aborted'), expert=expert, settings={'max_recoveries': 0})
    oracle_of(machine.machine).describe_failure = lambda state: 'no valid grasp'
    assert machine.run() == 'done'
    assert machine.of(EventKind.FAILURE)[0].text == 'no valid grasp'
    assert expert.questions[0].text == 'no valid grasp'
    assert any(text.endswith('A failed: aborted (no valid grasp)') for _, text in log)


def test_a_description_that_breaks_costs_only_itself(log):
    def broken(state):
        raise AttributeError('no status')

    machine = watched(Scripted('aborted'), Scripted())
    oracle_of(machine.machine).describe_failure = broken
    assert machine.run() == 'done'
    assert any('no status' in text for level, text in log if level == 'warn')


def test_outcomes_need_not_be_strings():
    sm = smach.StateMachine([1, 2])
    with sm:
        smach.StateMachine.add('A', Scripted(1, outcomes=(1, 2)), {1: 'B'})
        smach.StateMachine.add('B', Scripted(2, outcomes=(1, 2)))
    machine = Watched(sm)
    assert machine.run() == 2
    assert not machine.of(EventKind.FAILURE)


def test_an_outcome_registered_after_its_state_was_added_has_no_way_to_go():
    late = Scripted('late')
    machine = Watched(
        chain_of(late, outcomes=('done', 'aborted', 'preempted', 'late')), recover=False
    )
    late.register_outcomes(['late'])
    with pytest.raises(smach.InvalidTransitionError, match="'late' of state 'A'"):
        machine.run()
    assert kinds_of(machine) == [FailureKind.UNREGISTERED_OUTCOME]


def test_an_outcome_that_leads_nowhere_is_a_failure_though_it_is_intended():
    state = Scripted('left')
    machine = Watched(chain_of(state), settings={'states': {'A': {'intended_outcomes': ['left']}}})
    state.register_outcomes(['left'])
    assert machine.run() == 'done'
    assert kinds_of(machine) == [FailureKind.UNREGISTERED_OUTCOME]
