"""What ends the wait for health, and the repeats that nobody counts: a cap, and the budget."""

import pytest
from machines import (
    FakeExpert,
    FakeHealth,
    Scripted,
    Watched,
    chain_of,
    goto,
    supersede,
    watched,
)
from test_health import SETTINGS, fails_unwell, heals_at_once, notices

from smach_oracle.oracle.records.events import EventKind


@pytest.fixture
def health():
    return FakeHealth()


def flapping(health, times=100, expert=None, **settings):
    """A state that makes the robot unwell, for a moment, so often as it runs; and one behind."""
    machine = watched(
        Scripted(*[fails_unwell(health)] * times),
        Scripted(),
        health=health,
        expert=expert,
        settings=dict(SETTINGS, **settings),
    )
    heals_at_once(machine, health)
    return machine


@pytest.mark.parametrize('most, repeats', [(0, 1), (1, 1), (3, 3)])
def test_a_state_that_makes_the_robot_unwell_is_not_repeated_without_end(health, most, repeats):
    machine = flapping(health, max_recoveries=most)
    assert machine.run() == 'aborted'
    assert machine.visits() == ['A'] * (1 + repeats + most)
    assert len(machine.of(EventKind.FAILURE)) == 1 + most == machine.rate('A').failures
    # each failure is followed by a wait, counted or not
    assert len(machine.of(EventKind.HEALTH_WAIT_END)) == len(machine.visits())


def test_beyond_the_cap_a_person_is_asked_once_the_robot_is_well(health):
    expert = FakeExpert(supersede('ok'))
    machine = flapping(health, expert=expert, max_recoveries=0)
    assert machine.run() == 'done'
    kinds = [
        kind
        for kind in machine.kinds()
        if kind in ('FAILURE', 'HEALTH_WAIT_START', 'HEALTH_WAIT_END', 'QUERY_OPENED', 'SUPERSEDE')
    ]
    assert kinds == [
        'HEALTH_WAIT_START',
        'HEALTH_WAIT_END',
        'FAILURE',
        'HEALTH_WAIT_START',
        'HEALTH_WAIT_END',
        'QUERY_OPENED',
        'SUPERSEDE',
    ]


def test_each_trial_has_its_own_uncounted_repeats(health):
    machine = flapping(health, 1, max_recoveries=0)
    for _ in range(2):
        machine.machine.get_children()['A'].script[:] = [fails_unwell(health)]
        assert machine.run() == 'done'
    assert not machine.of(EventKind.FAILURE)


def test_the_minutes_end_the_wait(health, clock):
    machine = watched(
        Scripted(fails_unwell(health)),
        health=health,
        settings=dict(SETTINGS, budget={'minutes': 1}),
    )

    def pass_time(event):
        if event.kind is EventKind.HEALTH_WAIT_START:
            clock.advance(61.0)

    machine.machine.events.observers.append(pass_time)
    assert machine.run() == 'aborted'
    assert machine.visits() == ['A'] and notices(machine)[1].outcome == 'stopped'
    assert "the trial's 1 minute is over" in machine.of(EventKind.GIVE_UP)[0].text


def test_after_the_minutes_nobody_waits(health, clock):
    def late(state, ud):
        clock.advance(61.0)
        return fails_unwell(health)(state, ud)

    machine = watched(Scripted(late), health=health, settings=dict(SETTINGS, budget={'minutes': 1}))
    assert machine.run() == 'aborted'
    assert machine.visits() == ['A'] and not notices(machine)


def test_the_minutes_end_the_wait_before_a_jump(health, clock):
    def answer(question, cancelled, progress):
        health.now = 'motors: off'
        return goto('B')

    machine = watched(
        Scripted('aborted'),
        Scripted(),
        health=health,
        expert=FakeExpert(answer),
        settings=dict(SETTINGS, max_recoveries=0, budget={'minutes': 1}),
    )

    def pass_time(event):
        if event.kind is EventKind.HEALTH_WAIT_START:
            clock.advance(61.0)

    machine.machine.events.observers.append(pass_time)
    assert machine.run() == 'aborted' and machine.visits() == ['A']


def test_a_precondition_that_makes_the_robot_unwell_is_not_run_without_end(health):
    runs = []

    def trips(ud):
        runs.append(1)
        health.now = 'motors: off'
        return False

    machine = watched(
        Scripted('aborted'),
        health=health,
        preconditions={'A': [trips]},
        settings=dict(SETTINGS, max_recoveries=2),
    )
    heals_at_once(machine, health)
    machine.run()
    assert len(runs) == 3


def test_the_log_says_of_what_kind_a_failure_is_that_is_not_counted(health, log):
    assert flapping(health, times=1).run() == 'done'
    assert ('info', 'SM_ROOT/A failed, which is not counted: aborted') in log


@pytest.mark.parametrize('target, fails', [('aborted', 2), ('B', 1)])
def test_what_has_failed_as_a_preempt_comes_is_no_failure_though_the_robot_is_not_well(
    target, fails
):
    """It was repeated as often as it may be, or its author recovers from it."""

    def look():
        if first.runs == fails:
            machine.machine.request_preempt()
        return 'motors: off' if first.runs and first.runs != len(healed) else ''

    healed = []
    first = Scripted('aborted', 'aborted')
    bare = chain_of(first, Scripted())
    bare._transitions['A']['aborted'] = target
    machine = Watched(bare, health=look, settings=dict(SETTINGS, max_recoveries=0))
    machine.machine.events.observers.append(
        lambda event: healed.append(event) if event.kind is EventKind.HEALTH_WAIT_START else None
    )
    machine.run()
    assert not machine.of(EventKind.FAILURE) and first.runs == fails
    ends = [event.data for event in machine.of(EventKind.TRANSITION) if event.state == 'A']
    assert ends == ([None] if target == 'B' else [])


def test_a_visit_that_fails_as_a_preempt_comes_is_a_preempted_one():
    """Its author recovers from it, and what serviced the preempt lets the machine go on."""

    def look():
        if first.runs and not second.runs:
            machine.machine.request_preempt()
        return ''

    first = Scripted('aborted', ValueError())
    second = Scripted(lambda state, ud: state.service_preempt() or 'ok')
    bare = chain_of(first, second)
    bare._transitions['A'].update(ok='done', aborted='B')
    bare._transitions['B'].update(ok='A')
    expert = FakeExpert(supersede('ok'))
    settings = dict(SETTINGS, policy='always_ask')
    machine = Watched(bare, health=look, expert=expert, settings=settings)
    assert machine.run() == 'done'
    history = [(visit.state, visit.result.name) for visit in expert.questions[0].history]
    assert history == [('A', 'PREEMPTED'), ('B', 'PREEMPTED'), ('A', 'FAILURE')]
