"""States that are not repeated by themselves: `on_retry: confirm` and `never`."""

import threading

import pytest
from guarded_machines import (
    CONFIRM,
    HELD_BACK,
    NEVER,
    OUTCOMES,
    chain,
    deciders,
    guarded,
    pouring,
    sentences,
)
from machines import FakeExpert, Scripted, Watched, give_up, goto, in_thread, supersede

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.asking.answer_rules import check_answer, choices_of
from smach_oracle.oracle.errors import AnswerError
from smach_oracle.oracle.records.events import EventKind, FailureKind
from smach_oracle.oracle.records.facts import Decider

# -- what the oracle does by itself


@pytest.mark.parametrize('policy', ['prose', 'algorithm1'])
def test_a_guarded_state_that_has_failed_is_not_tried_again_by_itself(policy):
    machine, expert = guarded(pouring(pour=['aborted']), give_up(), policy=policy)
    assert machine.run() == 'aborted'
    assert machine.visits() == ['DETECT', 'POUR']
    assert sentences(machine) == [
        'POUR failed (its first result); it is not repeated by itself: asking an expert, 300 s'
    ]
    assert deciders(machine) == [Decider.ON_RETRY]
    assert expert.questions[0].reason.endswith('it is not repeated by itself')


def test_no_precondition_is_run_where_nothing_will_be_decided():
    look = Scripted()
    machine, _ = guarded(
        pouring(pour=['aborted']), give_up(), states={'POUR': dict(NEVER, preconditions=[look])}
    )
    assert machine.run() == 'aborted'
    assert look.runs == 0


def test_prose_steps_back_no_further_than_a_guarded_state_allows():
    machine = chain(
        DETECT=Scripted(),
        POUR=Scripted(),
        LIFT=Scripted(),
        PLACE=Scripted('aborted', 'aborted', 'aborted'),
    )
    watched, expert = guarded(machine, give_up())
    assert watched.run() == 'done', 'LIFT lies behind POUR'
    assert not expert.questions and watched.visits().count('POUR') == 1
    assert ('step_back', 'LIFT') in watched.decisions()


@pytest.mark.parametrize('on_retry', ['confirm', 'never'])
def test_a_step_back_to_the_guarded_state_becomes_a_question(on_retry):
    machine, expert = guarded(pouring('aborted', 'aborted'), goto('PLACE'), on_retry=on_retry)
    assert machine.run() == 'done'
    assert machine.decisions() == [('revisit', 'PLACE'), ('ask', '')]
    assert sentences(machine)[1] == (
        'PLACE keeps failing after trying it again (2 of its last 2); going back to POUR would '
        'repeat POUR: asking an expert, 300 s'
    )
    assert expert.questions[0].reason.endswith('going back to POUR would repeat POUR')
    assert deciders(machine) == [Decider.POLICY, Decider.ON_RETRY]


def test_a_step_back_across_a_guarded_state_becomes_a_question():
    """The precondition of POUR keeps algorithm1 from stepping back to POUR itself."""
    machine, expert = guarded(
        pouring('aborted'),
        goto('PLACE'),
        policy='algorithm1',
        states={'POUR': dict(CONFIRM, preconditions=[lambda ud: True])},
    )
    assert machine.run() == 'done'
    assert machine.visits() == ['DETECT', 'POUR', 'PLACE', 'PLACE']
    assert sentences(machine) == [
        'PLACE failed (its first result); going back to DETECT would '
        'repeat POUR: asking an expert, 300 s'
    ]
    assert deciders(machine) == [Decider.ON_RETRY] and len(expert.questions) == 1


def test_it_may_be_set_for_all_states():
    machine, expert = guarded(
        pouring('aborted'), give_up(), of_all='never', states={'POUR': {'on_retry': 'allow'}}
    )

    assert machine.run() == 'aborted'
    assert [question.failed_state for question in expert.questions] == ['PLACE']
    assert [choice.blocked != '' for choice in expert.questions[0].choices] == [True, False, True]


def test_it_may_be_given_with_add():
    machine = OracleContainer(outcomes=OUTCOMES, expert=FakeExpert())
    with machine:
        OracleContainer.add('POUR', Scripted('aborted'), {'ok': 'done'}, on_retry='confirm')
    assert machine.execute() == 'aborted'
    assert machine.rates()[0].recoveries == 0


def test_nobody_to_ask_is_the_end_and_a_fallback_repeats_nothing():
    machine, _ = guarded(pouring('aborted'), max_recoveries=0, on_no_answer='goto:DETECT')
    assert machine.run() == 'aborted'
    assert machine.visits() == ['DETECT', 'POUR', 'PLACE']
    assert 'going back to DETECT would repeat POUR' in machine.of(EventKind.WARNING)[-1].text
    assert 'fallback: stop with aborted' in machine.of(EventKind.QUERY_EXPIRED)[0].text


def test_a_fallback_ends_with_an_outcome_though_a_state_has_its_name():
    machine = smach.StateMachine(outcomes=['aborted', 'PARK'])
    with machine:
        smach.StateMachine.add('POUR', Scripted('aborted'), {'ok': 'PARK', 'preempted': 'PARK'})
        smach.StateMachine.add('PARK', Scripted(), {'ok': 'aborted', 'preempted': 'aborted'})
    watched, _ = guarded(machine, max_recoveries=0, on_no_answer='give_up:PARK')

    assert watched.run() == 'PARK'
    assert watched.visits() == ['POUR']
    assert 'fallback: end with PARK' in watched.of(EventKind.QUERY_EXPIRED)[0].text


def test_a_fallback_may_lead_to_a_place_from_which_nothing_is_repeated():
    machine = smach.StateMachine(outcomes=OUTCOMES)
    with machine:
        smach.StateMachine.add('POUR', Scripted(), {'ok': 'PLACE'})
        smach.StateMachine.add('PLACE', Scripted('aborted'), {'ok': 'done'})
        smach.StateMachine.add('PARK', Scripted(), {'ok': 'done'})
    watched, _ = guarded(machine, max_recoveries=0, on_no_answer='goto:PARK')
    assert watched.run() == 'done'
    assert watched.visits() == ['POUR', 'PLACE', 'PARK']


def behind_a_held_back_state(fallback, *answers):
    """DETECT, POUR, HOME, PLACE; PLACE fails once, and an expert goes to DETECT."""
    machine = chain(DETECT=Scripted(), POUR=Scripted(), HOME=Scripted(), PLACE=Scripted('aborted'))
    return guarded(
        machine,
        goto('DETECT'),
        *answers,
        max_recoveries=0,
        deadline_s=0.1,
        on_no_answer='goto:' + fallback,
    )


def test_a_fallback_leads_past_a_state_that_was_held_back():
    machine, expert = behind_a_held_back_state('HOME', None)
    assert machine.run() == 'done'
    assert machine.visits() == ['DETECT', 'POUR', 'HOME', 'PLACE', 'DETECT', 'HOME', 'PLACE']
    assert [choice.state for choice in expert.questions[1].choices if choice.repeats] == [
        'DETECT',
        'POUR',
    ]


def test_a_fallback_does_not_lead_before_a_state_that_was_held_back():
    machine, expert = behind_a_held_back_state('DETECT', None)
    assert machine.run() == 'aborted'
    assert machine.visits() == ['DETECT', 'POUR', 'HOME', 'PLACE', 'DETECT']


def test_what_an_expert_has_done_counts_as_done_then():
    machine, expert = guarded(
        chain(DETECT=Scripted(), POUR=Scripted(), PLACE=Scripted('aborted', 'aborted')),
        goto('DETECT'),
        supersede('ok'),
        give_up(),
        max_recoveries=0,
    )
    assert machine.run() == 'aborted'
    assert [
        choice.repeats for choice in expert.questions[2].choices if choice.state == 'DETECT'
    ] == [('POUR',)]


def test_a_fallback_that_repeats_nothing_is_taken():
    machine, _ = guarded(pouring('aborted'), max_recoveries=0, on_no_answer='goto:PLACE')
    assert machine.run() == 'done'


# -- what an expert may do


def test_an_expert_goes_back_and_is_asked_before_the_state_is_repeated():
    machine, expert = guarded(pouring('aborted'), goto('DETECT'), goto('POUR'), max_recoveries=0)
    assert machine.run() == 'done'
    assert machine.visits() == ['DETECT', 'POUR', 'PLACE', 'DETECT', 'POUR', 'PLACE']
    held = expert.questions[1]
    assert (held.failed_state, held.failure_kind) == ('POUR', FailureKind.HELD_BACK)
    assert not held.continuous
    assert sentences(machine)[1] == HELD_BACK + ': asking an expert, 300 s'
    assert deciders(machine)[1] == Decider.HELD_BACK
    assert [event.state for event in machine.of(EventKind.FAILURE)] == ['PLACE']
    row = machine.rate('POUR')
    assert (row.successes, row.failures) == (2, 0), 'what was held back counts as no visit'


def test_a_confirmed_repeat_holds_once():
    machine, expert = guarded(
        pouring('aborted', 'aborted'),
        goto('DETECT'),
        goto('POUR'),
        goto('DETECT'),
        give_up(),
        max_recoveries=0,
    )
    assert machine.run() == 'aborted'
    assert machine.visits().count('POUR') == 2
    assert [question.failed_state for question in expert.questions] == [
        'PLACE',
        'POUR',
        'PLACE',
        'POUR',
    ]


def test_going_directly_to_a_state_confirms_that_one_alone():
    states = chain(POUR=Scripted(), CUT=Scripted(), PLACE=Scripted('aborted'))
    machine, expert = guarded(
        states,
        goto('POUR'),
        goto('PLACE'),
        states={'POUR': CONFIRM, 'CUT': CONFIRM},
        max_recoveries=0,
    )
    assert machine.run() == 'done'
    assert machine.visits() == ['POUR', 'CUT', 'PLACE', 'POUR', 'PLACE']
    assert expert.questions[1].failed_state == 'CUT'


def test_an_expert_is_refused_a_state_that_is_never_repeated():
    machine, expert = guarded(
        pouring('aborted'),
        goto('POUR'),
        goto('DETECT'),
        goto('POUR'),
        supersede('ok'),
        on_retry='never',
        max_recoveries=0,
    )
    assert machine.run() == 'done'
    assert machine.visits() == ['DETECT', 'POUR', 'PLACE', 'DETECT', 'PLACE']
    why = 'was done in this trial and must not be repeated (on_retry: never)'
    assert {choice.state: choice.blocked for choice in expert.questions[0].choices} == {
        'DETECT': '',
        'POUR': why,
        'PLACE': '',
    }
    refused = [event.text for event in machine.of(EventKind.WARNING)]
    assert len(refused) == 2 and all(
        'POUR cannot be entered now: ' + why in text for text in refused
    )
    assert [question.failed_state for question in expert.questions] == [
        'PLACE',
        'PLACE',
        'POUR',
        'POUR',
    ]


def test_the_rules_of_answers_name_the_reason():
    machine, expert = guarded(pouring('aborted'), give_up(), on_retry='never', max_recoveries=0)
    machine.run()
    with pytest.raises(AnswerError, match='must not be repeated.*allowed: DETECT, PLACE'):
        check_answer(goto('POUR'), choices_of(expert.questions[0]))


def test_a_question_says_what_would_come_again_behind_each_choice():
    states = chain(
        DETECT=Scripted(),
        POUR=Scripted(),
        LIFT=Scripted(),
        PLACE=Scripted('aborted'),
        LATER=Scripted(),
    )
    machine, expert = guarded(states, give_up(), max_recoveries=0)
    machine.run()
    assert {choice.state: choice.repeats for choice in expert.questions[0].choices} == {
        'DETECT': ('POUR',),
        'POUR': ('POUR',),
        'LIFT': (),
        'PLACE': (),
        'LATER': (),
    }


def test_behind_a_state_never_visited_it_says_where_the_authors_transitions_lead():
    states = chain(
        ARM=chain(POUR=Scripted()),
        DETECT=Scripted('aborted'),
        LATER=Scripted(),
        LAST=Scripted(outcomes=('ok', 'again', 'aborted')),
    )
    states._transitions['LAST']['again'] = 'ARM'
    machine, expert = guarded(states, give_up(), max_recoveries=0)
    machine.run()
    assert {choice.state: choice.repeats for choice in expert.questions[0].choices} == {
        'ARM': ('ARM/POUR',),
        'POUR': ('ARM/POUR',),
        'DETECT': (),
        'LATER': ('ARM/POUR',),
        'LAST': ('ARM/POUR',),
    }


def test_a_fallback_does_not_lead_to_where_the_way_leads_back():
    states = smach.StateMachine(outcomes=OUTCOMES)
    with states:
        smach.StateMachine.add('POUR', Scripted(), {'ok': 'PLACE'})
        smach.StateMachine.add('PLACE', Scripted('aborted'), {'ok': 'done'})
        smach.StateMachine.add('LATER', Scripted(), {'ok': 'POUR'})
    machine, _ = guarded(states, max_recoveries=0, on_no_answer='goto:LATER')
    assert machine.run() == 'aborted'
    assert (
        'this trial has not been in LATER, and going there may repeat POUR; stopping'
        in machine.of(EventKind.WARNING)[-1].text
    )


def test_a_state_that_was_not_done_is_no_repeat():
    states = chain(DETECT=Scripted('aborted'), POUR=Scripted(), PLACE=Scripted())
    machine, _ = guarded(states, goto('POUR'), on_retry='never', max_recoveries=0)
    assert machine.run() == 'done'
    assert machine.visits() == ['DETECT', 'POUR', 'PLACE']


def test_what_lies_behind_a_state_never_visited_is_not_known():
    states = chain(POUR=Scripted(), DETECT=Scripted('aborted'), LIFT=Scripted(), SPARE=Scripted())
    states._transitions['SPARE']['ok'] = 'POUR'
    machine, expert = guarded(states, goto('SPARE'), give_up(), max_recoveries=0)
    assert machine.run() == 'aborted'
    assert machine.visits() == ['POUR', 'DETECT', 'SPARE']
    assert expert.questions[1].failed_state == 'POUR'


def test_with_nobody_to_ask_a_spent_state_ends_the_machine_as_configured():
    machine, _ = guarded(pouring('aborted'), goto('DETECT'), max_recoveries=0)
    assert machine.run() == 'aborted'
    assert machine.visits() == ['DETECT', 'POUR', 'PLACE', 'DETECT']
    assert [event.text for event in machine.of(EventKind.GIVE_UP)] == ['no answer by the deadline']


def test_a_machine_without_a_failing_outcome_ends_in_an_error_at_a_spent_state():
    machine = smach.StateMachine(outcomes=['done'])
    with machine:
        smach.StateMachine.add(
            'POUR', Scripted(), {'ok': 'PLACE', 'aborted': 'done', 'preempted': 'done'}
        )
        smach.StateMachine.add(
            'PLACE',
            Scripted(ValueError('slipped')),
            {'ok': 'done', 'aborted': 'done', 'preempted': 'done'},
        )
        smach.StateMachine.add(
            'BEFORE', Scripted(), {'ok': 'POUR', 'aborted': 'done', 'preempted': 'done'}
        )
    watched, _ = guarded(machine, goto('BEFORE'), max_recoveries=0)
    with pytest.raises(smach.InvalidUserCodeError, match=HELD_BACK[5:]):
        watched.run()


# -- the author's own ways


def looping(*check):
    """POUR, CHECK; CHECK leads back to POUR by 'again'."""
    machine = smach.StateMachine(outcomes=OUTCOMES)
    outcomes = ('ok', 'again', 'aborted')
    with machine:
        smach.StateMachine.add('POUR', Scripted(), {'ok': 'CHECK'})
        smach.StateMachine.add(
            'CHECK', Scripted(*check, outcomes=outcomes), {'again': 'POUR', 'ok': 'done'}
        )
    return machine


@pytest.mark.parametrize('on_retry', ['confirm', 'never'])
def test_the_authors_own_loop_is_free(on_retry):
    machine, expert = guarded(looping('again', 'again'), on_retry=on_retry)
    assert machine.run() == 'done'
    assert machine.visits().count('POUR') == 3 and not expert.questions


def test_the_authors_own_loop_is_free_after_a_revisit_of_another_state():
    machine, expert = guarded(looping('aborted', 'again'))
    assert machine.run() == 'done'
    assert machine.visits() == ['POUR', 'CHECK', 'CHECK', 'POUR', 'CHECK']
    assert not expert.questions


def test_a_superseded_state_leads_into_the_authors_loop():
    machine, expert = guarded(looping('aborted'), supersede('again'), max_recoveries=0)
    assert machine.run() == 'done'
    assert machine.visits() == ['POUR', 'CHECK', 'POUR', 'CHECK'] and len(expert.questions) == 1


def test_once_an_expert_has_done_it_the_authors_loop_is_free_again():
    states = looping('aborted', 'again')
    with states:
        smach.StateMachine.add('BEFORE', Scripted(), {'ok': 'POUR'})
    machine, expert = guarded(states, goto('BEFORE'), supersede('ok'), max_recoveries=0)
    assert machine.run() == 'done'
    assert machine.visits() == ['POUR', 'CHECK', 'BEFORE', 'CHECK', 'POUR', 'CHECK']
    results = [visit.result.name for visit in states._oracle.records.history.latest()]
    assert results == [
        'SUCCESS',
        'FAILURE',
        'SUCCESS',
        'SUPERSEDED',
        'SUCCESS',
        'SUCCESS',
        'SUCCESS',
    ]


def test_a_new_trial_begins_anew():
    machine, expert = guarded(
        pouring('aborted'), goto('DETECT'), give_up(), on_retry='never', max_recoveries=0
    )
    assert machine.run() == 'aborted'
    assert machine.run() == 'done' and len(expert.questions) == 2


def test_what_is_only_observed_is_not_guarded():
    machine = Watched(looping('again'), recover=False, settings=NEVER)
    assert machine.run() == 'done'


# -- the rest


def test_a_preempt_at_a_spent_state_ends_the_machine_as_preempted():
    def preempted_too_late(state, ud):
        machine.machine.request_preempt()
        return 'ok'

    states = chain(
        DETECT=Scripted('ok', preempted_too_late), POUR=Scripted(), PLACE=Scripted('aborted')
    )
    machine, expert = guarded(states, goto('DETECT'), max_recoveries=0)
    assert machine.run() == 'preempted'
    assert machine.visits() == ['DETECT', 'POUR', 'PLACE', 'DETECT'] and len(expert.questions) == 1
    assert not states._states['POUR'].preempt_requested()
    assert machine.run() == 'done', 'no request is left over'


def test_a_question_about_a_spent_state_is_taken_back_by_a_preempt():
    asked = threading.Event()

    def waits(question, cancelled, progress):
        asked.set()
        assert cancelled.wait(20)

    machine, _ = guarded(pouring('aborted'), goto('DETECT'), waits, max_recoveries=0)
    run = in_thread(machine.run)
    assert asked.wait(20)
    machine.machine.request_preempt()
    assert run.result() == 'preempted'


def test_a_state_with_a_time_limit_is_guarded_too():
    pour = Scripted()
    machine, expert = guarded(
        chain(DETECT=Scripted(), POUR=pour, PLACE=Scripted('aborted')),
        goto('DETECT'),
        max_recoveries=0,
        states={'POUR': dict(NEVER, time_limit_s=20)},
    )
    assert machine.run() == 'aborted'
    assert pour.runs == 1


def test_where_no_state_is_guarded_nothing_is_noted():
    machine = Watched(pouring('aborted'))
    assert machine.run() == 'done'
    node = machine.machine._oracle
    assert not node.tree.numbers_visits and not any(
        record.special for record in node.records.by_label.values()
    )
    assert node.records.marks['POUR'].reached == 0


def test_guards_come_and_go_with_the_settings():
    states = looping('aborted', 'ok', 'aborted', 'ok')
    machine = OracleContainer.wrap(states, settings={'states': {'POUR': NEVER}})
    assert machine.execute() == 'done' and machine._oracle.record('CHECK').special
    OracleContainer.wrap(states)
    assert machine.execute() == 'done' and not machine._oracle.record('CHECK').special
