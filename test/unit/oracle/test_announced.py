"""Failures that a later state reports, and failures that no end of a container shows."""

import pytest
from machines import FakeExpert, Scripted, Watched, give_up, goto, supersede
from reporting_machines import BAD, made, reporting
from test_ways import at_once

from smach_oracle.oracle.records.events import EventKind, FailureKind


def told(machine, *kinds):
    return [(event.kind.name, event.state) for event in machine.of(*kinds)]


def test_the_oracle_recovers_from_the_failure_that_a_state_reports():
    machine = reporting(Scripted('failed', outcomes=BAD))
    assert machine.run() == 'done'
    assert machine.visits() == ['LOOK', 'WORK', 'REPORT', 'WORK']
    assert told(machine, EventKind.FAILURE, EventKind.DECISION, EventKind.JUMP) == [
        ('FAILURE', 'WORK'),
        ('DECISION', 'WORK'),
        ('JUMP', 'WORK'),
    ]
    assert (machine.rate('WORK').failures, machine.rate('WORK').recoveries) == (1, 1)
    assert (machine.rate('REPORT').failures, machine.rate('REPORT').successes) == (0, 1)


@pytest.mark.parametrize('says', ['said', 'succeeded', 'done', 'low'])
def test_whatever_the_reporting_state_says(says):
    machine = reporting(Scripted('failed', outcomes=BAD), Scripted(outcomes=(says,)))
    assert machine.run() == 'done'
    assert machine.rate('REPORT').failures == 0


def test_an_outcome_that_is_listed_as_a_failure_reports_no_other():
    machine = reporting(
        Scripted('failed', outcomes=BAD),
        Scripted(outcomes=('said',)),
        settings={'states': {'REPORT': {'failure_outcomes': ['said']}}},
    )
    assert machine.run() == 'done'
    assert told(machine, EventKind.FAILURE, EventKind.DECISION)[:3] == [
        ('FAILURE', 'WORK'),
        ('FAILURE', 'REPORT'),
        ('DECISION', 'REPORT'),
    ]


def test_the_state_that_reports_it_may_come_later():
    between = [
        ('STOW', Scripted(outcomes=('stowed',)), {'stowed': 'CALL'}),
        ('CALL', Scripted(outcomes=('called',)), {'called': 'REPORT'}),
    ]
    machine = reporting(Scripted('failed', outcomes=BAD), between=between)
    assert machine.run() == 'done'
    assert machine.visits() == ['LOOK', 'WORK', 'STOW', 'CALL', 'REPORT', 'WORK']


def test_a_second_trial_finds_it_again_on_the_short_way():
    work = Scripted('failed', 'ok', 'failed', 'ok', 'failed', 'ok', outcomes=BAD)
    machine = reporting(work)
    assert [machine.run() for _ in range(3)] == ['done'] * 3
    assert machine.visits() == ['LOOK', 'WORK', 'REPORT', 'WORK'] * 3


def test_a_failure_that_keeps_coming_is_continuous_and_leads_further_back():
    machine = reporting(Scripted('failed', 'failed', outcomes=BAD), settings={'memory': 100})
    assert machine.run() == 'done'
    assert machine.decisions() == [('revisit', 'WORK'), ('step_back', 'LOOK')]
    assert [event.continuous for event in machine.of(EventKind.FAILURE)] == [False, True]
    assert [event.continuous for event in machine.of(EventKind.DECISION)] == [False, True]


def test_a_step_back_of_the_listing_leads_to_what_was_before_the_failed_state():
    machine = reporting(Scripted('failed', outcomes=BAD), settings={'policy': 'algorithm1'})
    assert machine.run() == 'done'
    assert machine.decisions() == [('step_back', 'LOOK')]


def test_a_way_back_leads_to_what_was_before_the_failed_state():
    machine = reporting(Scripted(*['failed'] * 3, outcomes=BAD), settings={'policy': 'escalating'})
    assert at_once(machine).run() == 'done'
    assert not [event for event in machine.of(EventKind.JUMP) if event.target == 'REPORT']


def test_the_question_is_about_the_failed_state():
    expert = FakeExpert(goto('WORK'))
    machine = reporting(
        Scripted('failed', outcomes=BAD), expert=expert, settings={'max_recoveries': 0}
    )
    assert machine.run() == 'done'
    (question,) = expert.questions
    assert (question.failed_state, question.outcome) == ('WORK', 'failed')
    assert question.failure_kind is FailureKind.FAILING_OUTCOME
    assert question.text == 'REPORT has ended with said since, which leads to failed'
    assert {choice.outcome for choice in question.supersede_outcomes} == set(BAD)


def test_an_expert_who_did_the_work_supersedes_the_failed_state():
    machine = reporting(
        Scripted('failed', outcomes=BAD),
        expert=FakeExpert(supersede('ok')),
        settings={'max_recoveries': 0},
    )
    assert machine.run() == 'done'
    assert machine.visits() == ['LOOK', 'WORK', 'REPORT']
    assert machine.rate('WORK').failures == 0, 'it is taken back'


def test_without_a_way_the_machine_ends_as_its_author_drew():
    for expert in (FakeExpert(give_up()), None):
        machine = reporting(
            Scripted('failed', outcomes=BAD), expert=expert, settings={'max_recoveries': 0}
        )
        assert machine.run() == 'failed'
        assert machine.visits() == ['LOOK', 'WORK', 'REPORT']


def test_a_state_that_has_succeeded_since_has_overcome_its_failure():
    check = Scripted('low', outcomes=('fine', 'low'))
    machine = Watched(
        made(
            [
                ('WORK', Scripted('failed', outcomes=BAD), {'ok': 'CHECK', 'failed': 'RESET'}),
                ('RESET', Scripted(outcomes=('ready',)), {'ready': 'WORK'}),
                ('CHECK', check, {'fine': 'done', 'low': 'failed'}),
            ]
        )
    )
    assert machine.run() == 'done'
    assert machine.visits() == ['WORK', 'RESET', 'WORK', 'CHECK', 'CHECK']
    assert told(machine, EventKind.FAILURE) == [('FAILURE', 'WORK'), ('FAILURE', 'CHECK')]


def test_of_several_it_is_the_latest():
    first, second = Scripted('failed', outcomes=BAD), Scripted('failed', outcomes=BAD)
    machine = Watched(
        made(
            [
                ('A', first, {'ok': 'B', 'failed': 'B'}),
                ('B', second, {'ok': 'done', 'failed': 'REPORT'}),
                ('REPORT', Scripted(outcomes=('said',)), {'said': 'failed'}),
            ]
        )
    )
    assert machine.run() == 'done'
    assert machine.visits() == ['A', 'B', 'REPORT', 'B']


def test_a_failure_that_was_taken_up_is_not_taken_up_for_another():
    """LOOK ends the machine after a step back. WORK has not failed again by then."""
    look = Scripted('seen', 'none', 'seen', outcomes=('seen', 'none'))
    machine = Watched(
        made(
            [
                ('LOOK', look, {'seen': 'WORK', 'none': 'failed'}),
                ('WORK', Scripted('failed', outcomes=BAD), {'ok': 'done', 'failed': 'REPORT'}),
                ('REPORT', Scripted(outcomes=('said',)), {'said': 'failed'}),
            ]
        ),
        settings={'policy': 'algorithm1'},
    )
    assert machine.run() == 'done'
    assert told(machine, EventKind.FAILURE) == [('FAILURE', 'WORK'), ('FAILURE', 'LOOK')]
    assert machine.rate('LOOK').failures == 1


def test_an_execution_of_the_container_before_does_not_count():
    work = Scripted('failed', 'ok', outcomes=BAD)
    machine = Watched(
        made(
            [
                ('WORK', work, {'ok': 'CHECK', 'failed': 'done'}),
                ('CHECK', Scripted('low', outcomes=('fine', 'low')), {'low': 'failed'}),
            ],
            outcomes=('done', 'fine', 'failed'),
        )
    )
    assert (machine.run(), machine.run()) == ('done', 'fine')
    assert told(machine, EventKind.FAILURE)[-1] == ('FAILURE', 'CHECK')


def test_without_a_failure_before_it_is_the_states_own():
    machine = Watched(
        made([('CHECK', Scripted('low', outcomes=('ok', 'low')), {'ok': 'done', 'low': 'failed'})])
    )
    assert machine.run() == 'done'
    assert machine.visits() == ['CHECK', 'CHECK']


@pytest.mark.parametrize('outcome', ['preempted', 'succeeded', 'success', 'completed'])
def test_a_success_or_a_preempt_is_none_wherever_it_leads(outcome):
    machine = Watched(
        made(
            [
                (
                    'NAV',
                    Scripted(outcome, outcomes=('ok', outcome)),
                    {'ok': 'done', outcome: 'failed'},
                )
            ]
        )
    )
    assert machine.run() == 'failed'
    assert machine.visits() == ['NAV']
    assert not machine.of(EventKind.FAILURE)


@pytest.mark.parametrize('says', ['succeeded', 'preempted'])
@pytest.mark.parametrize(
    'listed, end, visits', [(['failed'], 'done', ['NAV', 'NAV']), (None, 'failed', ['NAV'])]
)
def test_with_a_list_of_a_user_no_name_is_excused(says, listed, end, visits):
    nav = Scripted(says, outcomes=('ok', says))
    machine = Watched(
        made([('NAV', nav, {'ok': 'done', says: 'failed'})]),
        settings={'failing_outcomes': listed},
    )
    assert machine.run() == end
    assert machine.visits() == visits


@pytest.mark.parametrize('says', ['said', 'succeeded', 'low'])
@pytest.mark.parametrize('listed', [['failed'], ['broken', 'failed']])
def test_with_a_list_of_a_user_a_failure_that_is_reported_is_that_of_the_first_state(says, listed):
    machine = reporting(
        Scripted('failed', outcomes=BAD),
        Scripted(outcomes=(says,)),
        settings={'failing_outcomes': listed},
    )
    assert machine.run() == 'done'
    assert machine.visits() == ['LOOK', 'WORK', 'REPORT', 'WORK']
    assert told(machine, EventKind.FAILURE) == [('FAILURE', 'WORK')]


def test_a_failure_is_not_taken_up_where_an_oracle_below_has_given_up():
    call = Scripted('aborted', outcomes=('said', 'aborted'))
    inner = made([('CALL', call, {})], outcomes=('said', 'aborted'))
    machine = Watched(
        made(
            [
                ('WORK', Scripted('failed', outcomes=BAD), {'ok': 'done', 'failed': 'REPORT'}),
                ('REPORT', inner, {'said': 'failed', 'aborted': 'failed'}),
            ]
        ),
        expert=FakeExpert(give_up('said')),
        settings={'max_recoveries': 0},
    )
    assert machine.run() == 'failed'
    assert machine.visits().count('WORK') == 1
    assert told(machine, EventKind.DECISION) == [('DECISION', 'CALL')]


@pytest.mark.parametrize('policy', ['prose', 'algorithm1'])
def test_another_failure_meanwhile_does_not_change_where_a_step_back_leads(policy):
    stow = Scripted('failed', outcomes=('stowed', 'failed'))
    machine = reporting(
        Scripted('failed', outcomes=BAD),
        between=[('STOW', stow, {'stowed': 'REPORT', 'failed': 'STOW'})],
        settings={'policy': policy},
        preconditions={'WORK': [lambda ud: policy != 'prose']},
    )
    assert machine.run() == 'done'
    assert machine.decisions() == [('step_back', 'LOOK')]


def test_a_failure_about_which_the_oracle_has_decided_is_not_taken_up_again():
    """WORK raises the second time, and an expert sends the machine to REPORT."""
    work = Scripted('failed', RuntimeError('jammed'), outcomes=BAD)
    retry = ('RETRY', Scripted(outcomes=('again',)), {'again': 'WORK'})
    report = Scripted('low', outcomes=('said', 'low'))
    machine = Watched(
        made(
            [
                ('WORK', work, {'ok': 'done', 'failed': 'RETRY'}),
                retry,
                ('REPORT', report, {'said': 'done', 'low': 'failed'}),
            ]
        ),
        expert=FakeExpert(goto('REPORT')),
        settings={'states': {'WORK': {'max_recoveries': 0}}},
    )
    assert machine.run() == 'done'
    assert machine.visits() == ['WORK', 'RETRY', 'WORK', 'REPORT', 'REPORT']


def test_where_the_oracle_only_observes_no_other_state_is_blamed():
    machine = reporting(Scripted('failed', outcomes=BAD), recover=False)
    assert machine.run() == 'failed'
    assert told(machine, EventKind.FAILURE) == [('FAILURE', 'WORK')]
    assert machine.rate('REPORT').successes == 1


# -- a container without a failing end


def ending_neutrally(work, settings=None, outcomes=('END',), **wrap):
    return Watched(
        made([('PICK', work, {'ok': 'END', 'failed': 'END'})], outcomes), settings=settings, **wrap
    )


def test_a_failing_outcome_that_ends_a_container_without_one_is_recovered_from():
    machine = ending_neutrally(Scripted('failed', outcomes=BAD))
    assert machine.run() == 'END'
    assert machine.visits() == ['PICK', 'PICK']
    assert machine.decisions() == [('revisit', 'PICK')]


def test_nobody_is_asked_about_it():
    expert = FakeExpert(*[goto('PICK')] * 9)
    machine = ending_neutrally(Scripted(*['failed'] * 99, outcomes=BAD), expert=expert)
    assert machine.run() == 'END'
    assert len(machine.visits()) > 1
    assert not expert.questions
    assert not machine.of(EventKind.QUERY_OPENED)


@pytest.mark.parametrize(
    'more, outcomes',
    [
        ({}, ('END', 'aborted')),  # the author could have said it
        ({'failing_outcomes': ['failed']}, ('END',)),
        ({'states': {'PICK': {'intended_outcomes': ['failed']}}}, ('END',)),
    ],
)
def test_it_is_the_authors_where_the_container_has_one_or_where_the_user_says_so(more, outcomes):
    machine = ending_neutrally(Scripted('failed', outcomes=BAD), more, outcomes)
    assert machine.run() == 'END'
    assert machine.visits() == ['PICK']


@pytest.mark.parametrize('intended, repaired', [([], ['WORK']), (['succeeded'], [])])
def test_an_outcome_that_its_author_means_reports_nothing(intended, repaired):
    machine = reporting(
        Scripted('failed', outcomes=BAD),
        Scripted(outcomes=('succeeded',)),
        settings={'states': {'REPORT': {'intended_outcomes': intended}}},
    )
    assert machine.run() == ('done' if repaired else 'failed')
    assert machine.visits() == ['LOOK', 'WORK', 'REPORT', *repaired]


def test_where_the_author_is_overridden_a_person_is_asked():
    expert = FakeExpert(goto('PICK'))
    machine = ending_neutrally(
        Scripted('failed', outcomes=BAD),
        {'author_recoveries': 'override', 'max_recoveries': 0},
        expert=expert,
    )
    assert machine.run() == 'END'
    assert len(expert.questions) == 1


def test_a_nested_container_without_a_failing_end_recovers_within():
    inner = made(
        [('PICK', Scripted('failed', outcomes=BAD), {'ok': 'END', 'failed': 'END'})], ['END']
    )
    machine = Watched(made([('ARM', inner, {'END': 'done'})]))
    assert machine.run() == 'done'
    assert told(machine, EventKind.JUMP) == [('JUMP', 'PICK')]


def test_what_its_end_leads_to_may_be_a_failure_above_of_which_a_person_is_asked():
    pick = Scripted(*['failed'] * 99, outcomes=BAD)
    inner = made([('PICK', pick, {'ok': 'END', 'failed': 'END'})], ['END'])
    expert = FakeExpert(give_up())
    machine = Watched(made([('ARM', inner, {'END': 'failed'})]), expert=expert)
    assert machine.run() == 'failed'
    assert [question.failed_state for question in expert.questions] == ['ARM']


# -- what its author means


def test_an_intended_outcome_is_never_a_failure_wherever_it_leads():
    for leads_to in ('failed', 'done', 'STOP'):
        machine = Watched(
            made(
                [
                    (
                        'BATTERY',
                        Scripted('low', outcomes=('ok', 'low')),
                        {'ok': 'done', 'low': leads_to},
                    ),
                    (
                        'STOP',
                        Scripted(),
                        {'ok': 'done', 'aborted': 'failed', 'preempted': 'failed'},
                    ),
                ]
            ),
            settings={
                'failure_outcomes': ['low'],
                'states': {'BATTERY': {'intended_outcomes': ['low']}},
            },
        )
        machine.run()
        assert machine.visits().count('BATTERY') == 1
        assert not machine.of(EventKind.FAILURE)
        assert machine.rate('BATTERY').successes == 1


def test_a_container_that_ends_by_an_intended_outcome_has_not_failed():
    battery = Scripted('low', 'low', 'aborted', outcomes=('ok', 'low', 'aborted'))
    inner = made(
        [('BATTERY', battery, {'ok': 'done', 'low': 'aborted'})], outcomes=('done', 'aborted')
    )
    middle = made([('ARM', inner, {'aborted': 'aborted'})], outcomes=('done', 'aborted'))
    machine = Watched(
        made([('ROBOT', middle, {'aborted': 'failed'})]),
        settings={'states': {'BATTERY': {'intended_outcomes': ['low']}}},
    )
    assert (machine.run(), machine.run()) == ('failed', 'failed')
    assert not machine.of(EventKind.FAILURE)
    assert machine.run() == 'done', 'another end in the same outcome is a failure'
    assert told(machine, EventKind.FAILURE) == [('FAILURE', 'BATTERY')]


def test_a_container_that_ends_once_as_intended_fails_the_next_time():
    battery = Scripted('low', 'ok', outcomes=('ok', 'low'))
    engine = Scripted(outcomes=('worn',))
    inner = made(
        [('BATTERY', battery, {'ok': 'ENGINE'}), ('ENGINE', engine, {'worn': 'low'})], ['low']
    )
    machine = Watched(
        made([('ARM', inner, {'low': 'done'})]),
        settings={
            'states': {
                'BATTERY': {'intended_outcomes': ['low']},
                'ARM': {'failure_outcomes': ['low'], 'max_recoveries': 0},
            }
        },
    )
    assert (machine.run(), machine.run()) == ('done', 'done')
    assert told(machine, EventKind.FAILURE) == [('FAILURE', 'ARM')]


# -- a loop of the author's own


def looping(script, settings=None):
    return Watched(
        made([('WAIT', Scripted(*script, outcomes=BAD), {'ok': 'done', 'failed': 'WAIT'})]),
        settings=settings,
    )


def test_a_state_that_keeps_failing_on_its_authors_way_is_told_once_in_a_trial():
    machine = looping((['failed'] * 30 + ['ok']) * 2)
    assert (machine.run(), machine.run()) == ('done', 'done')
    warnings = [event.text for event in machine.of(EventKind.WARNING)]
    assert len(warnings) == 2
    assert warnings[0].startswith('keeps failing: its author leads it from failed to WAIT')
    assert len(machine.visits()) == 62
    assert not machine.of(EventKind.DECISION)


def test_one_failure_of_a_class_that_is_high_already_is_no_loop():
    machine = looping(['failed', 'ok'], {'prior': 0.9})
    machine.run()
    assert not machine.of(EventKind.WARNING)


def test_a_loop_over_several_states_is_reported():
    machine = Watched(
        made(
            [
                ('A', Scripted(*['failed'] * 20, outcomes=BAD), {'ok': 'done', 'failed': 'B'}),
                ('B', Scripted(*['failed'] * 20, outcomes=BAD), {'ok': 'A', 'failed': 'A'}),
            ]
        )
    )
    machine.run()
    assert {event.state for event in machine.of(EventKind.WARNING)} == {'A', 'B'}


def test_a_state_with_the_name_of_a_failure_is_no_end_that_reports_one():
    machine = Watched(
        made(
            [
                ('WORK', Scripted('failed', outcomes=BAD), {'ok': 'done', 'failed': 'REPORT'}),
                ('REPORT', Scripted(outcomes=('succeeded',)), {'succeeded': 'aborted'}),
                ('aborted', Scripted(outcomes=('ok',)), {'ok': 'done'}),
            ]
        )
    )
    assert machine.run() == 'done'
    assert machine.visits() == ['WORK', 'REPORT', 'aborted'] and machine.decisions() == []


def test_a_success_that_has_led_to_a_failing_end_before_reports_a_failure_too():
    work = Scripted('ok', 'ok', 'failed', 'ok', outcomes=BAD)
    states = [
        ('WORK', work, {'ok': 'REPORT', 'failed': 'REPORT'}),
        ('REPORT', Scripted(outcomes=('succeeded',)), {'succeeded': 'failed'}),
    ]
    machine = Watched(made(states))
    assert [machine.run() for _ in range(3)] == ['failed'] * 3
    assert machine.visits()[4:] == ['WORK', 'REPORT', 'WORK', 'REPORT']
