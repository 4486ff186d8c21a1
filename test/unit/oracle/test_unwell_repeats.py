"""States that are not repeated by themselves, and have failed while the robot was not well."""

import pytest
from machines import FakeExpert, FakeHealth, Scripted, goto, in_thread, supersede, watched
from waiting import wait_for

from smach_oracle.oracle.records.events import EventKind


def fails_unwell(health):
    def fail(state, ud):
        health.now = 'motors: off'
        return 'aborted'

    return fail


def healthy_again(machine, health, run):
    assert wait_for(lambda: machine.of(EventKind.HEALTH_WAIT_START), 10)
    health.now = ''
    return run.result()


@pytest.fixture
def health():
    return FakeHealth()


@pytest.mark.parametrize(
    'answer, visited', [(goto('B'), ['A', 'B', 'B', 'C']), (supersede('ok'), ['A', 'B', 'C'])]
)
def test_a_state_that_is_not_repeated_by_itself_is_asked_about_once_all_is_well(
    health, answer, visited
):
    expert = FakeExpert(answer)
    machine = watched(
        Scripted(),
        Scripted(fails_unwell(health)),
        Scripted(),
        health=health,
        expert=expert,
        settings={'health_settle_s': 0.05, 'states': {'B': {'on_retry': 'confirm'}}},
    )
    run = in_thread(machine.run)
    assert healthy_again(machine, health, run) == 'done'
    assert machine.visits() == visited
    (question,) = expert.questions
    assert question.failed_state == 'B'
    assert 'failed while the robot was not well, and is not repeated by itself' in question.reason
    assert not machine.of(EventKind.FAILURE)
    assert machine.rate('B').failures == 0


def test_a_state_that_must_not_be_repeated_is_not_when_all_is_well_again(health):
    expert = FakeExpert(goto('B'), supersede('ok'))
    machine = watched(
        Scripted(),
        Scripted(fails_unwell(health)),
        Scripted(),
        health=health,
        expert=expert,
        settings={'health_settle_s': 0.05, 'states': {'B': {'on_retry': 'never'}}},
    )
    run = in_thread(machine.run)
    assert healthy_again(machine, health, run) == 'done'
    assert machine.visits() == ['A', 'B', 'C']
    assert len(expert.questions) == 2, 'the answer that names it is refused'


def test_a_precondition_that_failed_while_all_was_well_is_not_tried_again(health):
    """The robot is unwell once, when it has long been looked at for that."""
    clear = Scripted('aborted', 'ok')
    machine = watched(
        Scripted('aborted'),
        health=health,
        preconditions={'A': [clear]},
        settings={'health_settle_s': 0.0},
    )
    health.said = ['', '', 'motors: off']
    assert machine.run() == 'done'
    assert clear.runs == 1 and len(machine.of(EventKind.HEALTH_WAIT_START)) == 1
