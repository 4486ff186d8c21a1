"""Guarded states that preconditions run, and those in machines below."""

import threading

from guarded_machines import (
    ASKED_ABOUT,
    CONFIRM,
    HELD_BACK,
    NEVER,
    OUTCOMES,
    UNSURE,
    chain,
    guarded,
    pouring,
)
from machines import Scripted, give_up, goto, supersede

import smach
from smach_oracle.oracle.records.events import EventKind

# -- preconditions


def test_a_precondition_does_not_repeat_a_guarded_state():
    machine, _ = guarded(
        pouring('aborted'), states={'POUR': CONFIRM, 'PLACE': {'preconditions': ['POUR']}}
    )
    machine.run()
    (ended,) = machine.of(EventKind.PRECONDITION_END)
    assert (ended.outcome, ended.text) == ('not met', HELD_BACK)
    assert machine.visits().count('POUR') == 1


def test_a_state_that_a_precondition_gives_itself_is_known_by_its_label():
    pour = Scripted()
    states = chain(POUR=pour, PLACE=Scripted('aborted'))
    machine, _ = guarded(states, states={'POUR': NEVER, 'PLACE': {'preconditions': [pour]}})
    machine.run()
    assert machine.of(EventKind.PRECONDITION_END)[0].text == HELD_BACK and pour.runs == 1


def test_what_a_precondition_has_done_is_not_repeated_by_the_author():
    pour = Scripted()
    states = chain(OPEN=Scripted('aborted'), POUR=pour)
    machine, expert = guarded(
        states, supersede('ok'), states={'POUR': CONFIRM, 'OPEN': {'preconditions': ['POUR']}}
    )
    assert machine.run() == 'done'
    assert machine.decisions()[0] == ('revisit', 'OPEN'), 'it was done on purpose'
    assert pour.runs == 1
    assert [question.failed_state for question in expert.questions] == ['POUR']


def test_a_precondition_that_holds_a_guarded_state_does_not_repeat_it_either():
    pour = Scripted()
    states = chain(INNER=chain(POUR=pour), PLACE=Scripted('aborted', 'aborted'))
    machine, _ = guarded(
        states, give_up(), states={'POUR': CONFIRM, 'PLACE': {'preconditions': ['INNER']}}
    )
    machine.run()
    assert machine.of(EventKind.PRECONDITION_END)[0].text == 'INNER/' + HELD_BACK
    assert pour.runs == 1


def test_a_machine_that_is_a_precondition_may_do_it_once():
    pour = Scripted()
    states = chain(OPEN=Scripted('aborted', 'aborted'), INNER=chain(POUR=pour))
    machine, expert = guarded(
        states, give_up(), states={'POUR': CONFIRM, 'OPEN': {'preconditions': ['INNER']}}
    )
    machine.run()
    assert [event.outcome for event in machine.of(EventKind.PRECONDITION_END)] == ['met', 'not met']
    assert pour.runs == 1


# -- nested machines


def test_an_outer_oracle_does_not_repeat_what_lies_within():
    inner = chain(POUR=Scripted(), LIFT=Scripted('aborted', 'aborted'))
    machine, expert = guarded(
        chain(INNER=inner), give_up(), escalate=True, states={'POUR': CONFIRM, 'LIFT': UNSURE}
    )
    assert machine.run() == 'aborted'
    (question,) = expert.questions
    assert question.failed_state == 'LIFT'
    assert question.tried == (
        'SM_ROOT: INNER failed (its first result); trying it again would '
        'repeat INNER/POUR: asks too',
    )


def test_an_outer_oracle_may_repeat_a_machine_that_has_not_come_so_far():
    inner = chain(LIFT=Scripted('aborted', 'aborted'), POUR=Scripted())
    machine, expert = guarded(
        chain(INNER=inner), escalate=True, states={'POUR': CONFIRM, 'LIFT': UNSURE}
    )
    assert machine.run() == 'done'
    assert machine.decisions() == [('revisit', 'LIFT'), ('ask', ''), ('revisit', 'INNER')]
    assert not expert.questions


def test_within_a_machine_that_is_executed_again_the_question_is_about_the_state():
    inner = chain(POUR=Scripted(), LIFT=Scripted('aborted'))
    machine, expert = guarded(
        chain(INNER=inner),
        goto('INNER'),
        goto('POUR'),
        states={'POUR': CONFIRM, 'LIFT': ASKED_ABOUT},
    )
    assert machine.run() == 'done'
    asked = [(question.container_path, question.failed_state) for question in expert.questions]
    assert asked == [('SM_ROOT/INNER', 'LIFT'), ('SM_ROOT/INNER', 'POUR')]
    assert machine.visits() == ['INNER', 'POUR', 'LIFT', 'INNER', 'POUR', 'LIFT']


def test_a_guarded_state_in_another_container_is_confirmed_by_going_to_it():
    pour = Scripted()
    machine, expert = guarded(
        chain(INNER=chain(POUR=pour), LIFT=Scripted('aborted')), goto('POUR'), max_recoveries=0
    )
    assert machine.run() == 'done' and pour.runs == 2
    repeats = {
        (choice.container, choice.state): choice.repeats for choice in expert.questions[0].choices
    }
    assert repeats['SM_ROOT/INNER', 'POUR'] == ('INNER/POUR',)


def test_a_spent_state_that_nobody_confirms_ends_the_machine():
    inner = chain(POUR=Scripted(), LIFT=Scripted('aborted'))
    machine, expert = guarded(
        chain(INNER=inner), goto('INNER'), states={'POUR': CONFIRM, 'LIFT': ASKED_ABOUT}
    )
    assert machine.run() == 'aborted'
    assert [question.failed_state for question in expert.questions] == ['LIFT', 'POUR']
    assert machine.visits().count('INNER') == 2


def test_the_authors_loop_around_a_machine_leaves_its_states_free():
    pour = Scripted()
    inner = chain(POUR=pour, LIFT=Scripted('ok', 'aborted'))
    machine = smach.StateMachine(outcomes=OUTCOMES)
    with machine:
        smach.StateMachine.add('INNER', inner, {'done': 'AGAIN'})
        smach.StateMachine.add(
            'AGAIN', Scripted('again', outcomes=('ok', 'again')), {'again': 'INNER', 'ok': 'done'}
        )
    watched, expert = guarded(machine)
    assert watched.run() == 'done'
    assert pour.runs == 2 and not expert.questions


def test_a_guarded_state_of_an_earlier_round_is_not_held_against_this_one():
    """In the second round INNER fails before POUR, so that a revisit repeats nothing."""
    pour = Scripted()
    inner = chain(LIFT=Scripted('ok', 'aborted', 'aborted'), POUR=pour)
    machine = smach.StateMachine(outcomes=OUTCOMES)
    with machine:
        smach.StateMachine.add('INNER', inner, {'done': 'AGAIN'})
        smach.StateMachine.add(
            'AGAIN', Scripted('again', outcomes=('ok', 'again')), {'again': 'INNER', 'ok': 'done'}
        )
    watched, expert = guarded(machine, escalate=True, states={'POUR': NEVER, 'LIFT': UNSURE})
    assert watched.run() == 'done'
    assert pour.runs == 2 and not expert.questions


def test_a_state_deep_below_is_spent_by_a_jump_far_above():
    deep = chain(BOTTOM=chain(POUR=Scripted()))
    machine, expert = guarded(
        chain(DETECT=Scripted(), MIDDLE=deep, PLACE=Scripted('aborted')),
        goto('DETECT'),
        supersede('ok'),
        max_recoveries=0,
    )
    assert machine.run() == 'done'
    assert (expert.questions[1].container_path, expert.questions[1].failed_state) == (
        'SM_ROOT/MIDDLE/BOTTOM',
        'POUR',
    )


def both(**branches):
    concurrence = smach.Concurrence(
        outcomes=['done', 'aborted'],
        default_outcome='aborted',
        outcome_map={'done': dict.fromkeys(branches, 'done')},
    )
    with concurrence:
        for label, branch in branches.items():
            smach.Concurrence.add(label, branch)
    return concurrence


def test_the_branches_of_a_concurrence_do_not_hinder_each_other():
    poured = threading.Event()
    left = chain(POUR=Scripted(lambda state, ud: poured.set() or 'ok'))
    right = chain(
        LOOK=Scripted(),
        DRIVE=Scripted(lambda state, ud: 'aborted' if poured.wait(20) else 'ok', 'aborted'),
    )
    machine, expert = guarded(chain(BOTH=both(LEFT=left, RIGHT=right)))
    assert machine.run() == 'done'
    assert machine.decisions() == [('revisit', 'DRIVE'), ('step_back', 'LOOK')]
    assert not expert.questions


def test_a_concurrence_is_not_repeated_where_an_expert_gave_a_branch_up():
    left, right = chain(POUR=Scripted()), chain(DRIVE=Scripted('aborted'))
    machine, expert = guarded(
        chain(BOTH=both(LEFT=left, RIGHT=right)),
        give_up(),
        states={'POUR': CONFIRM, 'DRIVE': ASKED_ABOUT},
    )
    assert machine.run() == 'aborted'
    (question,) = expert.questions
    repeats = {choice.state: choice.repeats for choice in question.choices}
    assert question.failed_state == 'DRIVE'
    assert [event.state for event in machine.of(EventKind.FAILURE)] == ['DRIVE', 'BOTH']
    assert repeats['BOTH'] in ((), ('BOTH/LEFT/POUR',)), 'by which branch was faster'


def test_a_guarded_container_is_guarded_as_one():
    inner = chain(LIFT=Scripted('aborted'))
    machine, expert = guarded(
        chain(INNER=inner), goto('INNER'), states={'INNER': CONFIRM, 'LIFT': ASKED_ABOUT}
    )
    assert machine.run() == 'done'
    assert [question.failed_state for question in expert.questions] == ['LIFT']
    assert {choice.state: choice.repeats for choice in expert.questions[0].choices}['INNER']
