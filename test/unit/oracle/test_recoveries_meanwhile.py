"""What others do while the oracle recovers: spend the budget, take the time, preempt."""

import pytest
from guarded_machines import chain, deciders, sentences
from machines import (
    FakeExpert,
    FakeHealth,
    FakeWaiting,
    Gate,
    Scripted,
    Watched,
    give_up,
    in_thread,
    waits,
)

from smach_oracle.oracle import oracle_of
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.oracle.records.facts import Decider


def cleared(pick, *, clear, before=(), **settings):
    """PICK, whose precondition is CLEAR, a machine of SWEEP. `clear`: what SWEEP does."""
    states = {'CLEAR': chain(SWEEP=Scripted(*clear)), **dict(before), 'PICK': Scripted(*pick)}
    machine = Watched(
        chain(**states),
        expert=FakeExpert(give_up()),
        settings={
            'memory': 1000,
            'max_recoveries': 50,
            'states': {'PICK': {'preconditions': ['CLEAR']}},
            **settings,
        },
    )
    oracle_of(machine.machine).waiting = FakeWaiting()
    return machine


@pytest.mark.parametrize('policy, recoveries', [('prose', 1), ('escalating', 2)])
def test_the_last_recovery_may_be_spent_by_a_precondition(policy, recoveries):
    machine = cleared(
        ['aborted'] * 2,
        clear=['ok', 'aborted'],
        policy=policy,
        budget={'recoveries': recoveries},
    )
    assert machine.run() == 'aborted'
    told = [(event.state, event.outcome) for event in machine.of(EventKind.DECISION)]
    assert told[-2:] == [('SWEEP', 'revisit'), ('PICK', 'ask')]
    assert deciders(machine)[-2:] == [Decider.POLICY, Decider.BUDGET]
    spent = '1 recovery is' if recoveries == 1 else '2 recoveries are'
    assert "the trial's {} spent".format(spent) in sentences(machine)[-1]
    assert machine.machine._oracle.tree.budget.recoveries == recoveries


def test_the_last_attempt_of_a_policy_may_be_spent_by_a_precondition():
    """It makes do with eight in a trial: three each of A and B, one of PICK, one of SWEEP."""
    fails = ['aborted'] * 3
    machine = cleared(
        ['aborted'] * 2,
        clear=['ok'] * 3 + ['aborted'],
        before={'A': Scripted(*fails), 'B': Scripted(*fails)},
        policy='escalating',
    )
    assert machine.run() == 'aborted'
    told = [(event.state, event.outcome) for event in machine.of(EventKind.DECISION)]
    assert told[-3:] == [('PICK', 'revisit'), ('SWEEP', 'revisit'), ('PICK', 'ask')]
    assert deciders(machine)[-1] == Decider.POLICY
    assert "the trial's 8 attempts are spent" in sentences(machine)[-1]
    assert machine.of(EventKind.DECISION)[-1].data['order'] == []


def test_the_minutes_may_be_over_once_a_level_has_asked_its_preconditions(clock):
    """The level above that one runs none then."""

    def takes_long(ud):
        clock.advance(90)
        return False

    last = Scripted()
    machine = Watched(
        chain(OUTER=chain(INNER=chain(PICK=Scripted(*['aborted'] * 2)))),
        expert=FakeExpert(),
        settings={
            'memory': 1000,
            'escalate': True,
            'budget': {'minutes': 1},
            'states': {
                'PICK': {'prior': 0.5},
                'INNER': {'prior': 0.5, 'preconditions': [takes_long]},
                'OUTER': {'preconditions': [last]},
            },
        },
    )
    assert machine.run() == 'aborted'
    assert machine.decisions() == [('revisit', 'PICK'), ('ask', '')] and last.runs == 0


def test_a_preempt_ends_a_precondition_of_the_level_above():
    gate = Gate()
    machine = Watched(
        chain(LOOK=Scripted('ok', gate), ARM=chain(GRASP=Scripted(*['aborted'] * 2))),
        settings={
            'memory': 1000,
            'escalate': True,
            'states': {'GRASP': {'prior': 0.5}, 'ARM': {'preconditions': ['LOOK']}},
        },
    )
    run = in_thread(machine.run)
    assert gate.entered.wait(20)
    machine.machine.request_preempt()
    assert run.result() == 'preempted'
    assert machine.rate('ARM').failures == 0, 'its level has not decided'


def test_a_preempt_while_a_person_is_asked_reaches_no_precondition_that_has_ended():
    clear = Scripted('aborted')

    def ask(question, cancelled, progress):
        machine.machine.request_preempt()
        return waits(question, cancelled, progress)

    machine = Watched(
        chain(A=Scripted('aborted')),
        expert=FakeExpert(ask),
        settings={'memory': 1000, 'prior': 0.5, 'states': {'A': {'preconditions': [clear]}}},
    )
    assert machine.run() == 'preempted'
    assert clear.runs == 1 and not clear.preempt_requested()


def test_what_a_preempt_comes_for_at_the_end_of_a_wait_to_be_well_is_not_entered_again():
    health = FakeHealth()

    def falls(state, ud):
        health.now = 'motors: off'
        return 'aborted'

    def observe(event):
        if event.kind is EventKind.HEALTH_WAIT_START:
            health.now = ''
        if event.kind is EventKind.HEALTH_WAIT_END:
            machine.machine.request_preempt()

    machine = Watched(chain(A=Scripted(falls)), health=health, settings={'health_settle_s': 0.01})
    machine.machine.events.observers.append(observe)
    assert machine.run() == 'preempted'
    assert not machine.of(EventKind.JUMP) and machine.visits() == ['A']


def test_the_minutes_may_be_over_before_the_robot_is_well_enough_for_a_precondition(clock):
    health = FakeHealth()

    def falls(state, ud):
        health.now = 'motors: off'
        return 'aborted'

    look = Scripted(falls)
    machine = Watched(
        chain(A=Scripted('aborted')),
        health=health,
        settings={
            'health_settle_s': 0.05,
            'budget': {'minutes': 1},
            'states': {'A': {'preconditions': [look]}},
        },
    )
    assert machine.run() == 'aborted'
    assert look.runs == 1


def test_a_question_says_how_the_preconditions_have_ended():
    def holds(ud):
        return True

    def fails(ud):
        return False

    expert = FakeExpert(give_up('aborted'))
    machine = Watched(
        chain(A=Scripted('aborted')),
        expert=expert,
        settings={
            'memory': 1000,
            'prior': 0.5,
            'states': {'A': {'preconditions': [holds, fails]}},
        },
    )
    assert machine.run() == 'aborted'
    assert expert.questions[0].tried == (
        'precondition holds: met',
        'precondition fails: not met (fails returned False)',
    )


def test_while_the_robot_is_well_a_precondition_that_is_not_met_is_asked_about_once():
    """A look at what A has failed by, one at what the precondition has, and one before the jump."""
    health = FakeHealth()
    machine = Watched(
        chain(LOOK=Scripted(), A=Scripted('aborted')),
        health=health,
        settings={'health_settle_s': 0, 'states': {'A': {'preconditions': [lambda ud: False]}}},
    )
    assert machine.run() == 'done'
    assert health.asked == 3
