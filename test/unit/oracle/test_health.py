"""Failures while the robot is not well: nothing is counted, and the machine waits."""

import threading

import pytest
from machines import (
    FakeExpert,
    FakeHealth,
    Gate,
    Scripted,
    Watched,
    chain_of,
    contents,
    goto,
    in_thread,
    supersede,
    waits,
    watched,
)
from waiting import stays, wait_for

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.records.events import EventKind

SETTLE_S = 0.05
SETTINGS = {'health_settle_s': SETTLE_S}


def fails_unwell(health, why='motors: off', outcome='aborted'):
    """A step of a Scripted: the robot is not well, and so the state fails."""

    def fail(state, ud):
        health.now = why
        return outcome

    return fail


def notices(machine):
    return machine.of(EventKind.HEALTH_WAIT_START, EventKind.HEALTH_WAIT_END)


def awaits(machine):
    """Wait until the machine waits to be well."""
    assert wait_for(lambda: machine.of(EventKind.HEALTH_WAIT_START), 10)


def heals_at_once(machine, health):
    """Make the robot well as soon as the machine waits."""

    def heal(event):
        if event.kind is EventKind.HEALTH_WAIT_START:
            health.now = ''

    machine.machine.events.observers.append(heal)


def healthy_again(machine, health, run):
    awaits(machine)
    health.now = ''
    return run.result()


@pytest.fixture
def health():
    return FakeHealth()


def test_a_failure_while_unwell_is_not_counted_and_the_state_runs_again(health, log):
    failing = Scripted(fails_unwell(health))
    machine = watched(Scripted(), failing, Scripted(), health=health, settings=SETTINGS)
    run = in_thread(machine.run)
    awaits(machine)
    assert machine.machine.get_active_states() == ['ORACLE']
    assert healthy_again(machine, health, run) == 'done'
    assert machine.visits() == ['A', 'B', 'B', 'C']
    assert not machine.of(EventKind.FAILURE, EventKind.DECISION, EventKind.JUMP)
    row = machine.rate('B')
    assert (row.successes, row.failures, row.recoveries) == (1, 0, 0)
    start, end = notices(machine)
    assert (start.path, start.state, start.text) == ('SM_ROOT', 'B', 'FakeHealth: motors: off')
    assert (end.outcome, end.data['states']) == ('well', ['SM_ROOT/B'])
    assert end.data['waited_s'] >= SETTLE_S
    assert [text for level, text in log if level == 'warn'] == [
        'SM_ROOT/B failed while the robot is not well (FakeHealth: motors: off): waiting; no '
        'failure is counted'
    ]


@pytest.mark.parametrize('end', ['aborted', ValueError('x'), None])
def test_every_kind_of_failure_waits(end):
    health = FakeHealth(False, False)
    machine = watched(Scripted(end), Scripted(), health=health, settings=SETTINGS)
    assert machine.run() == 'done'
    assert machine.visits() == ['A', 'A', 'B']
    assert not machine.of(EventKind.FAILURE)


def test_a_failure_while_well_is_one(health):
    machine = watched(Scripted('aborted'), health=health, settings=SETTINGS)
    assert machine.run() == 'done'
    assert machine.decisions() == [('revisit', 'A')]
    assert not notices(machine)
    assert machine.rate('A').failures == 1


def test_a_run_stop_that_is_heard_of_after_the_failure_counts():
    health = FakeHealth('', 'run-stop')
    machine = watched(Scripted('aborted'), health=health, settings={'health_settle_s': 0.2})
    assert machine.run() == 'done'
    assert len(notices(machine)) == 2 and not machine.of(EventKind.FAILURE)


def test_a_plain_success_asks_nobody(health):
    health.now = 'motors: off'
    machine = watched(Scripted(), Scripted(), health=health, settings=SETTINGS)
    assert machine.run() == 'done'
    assert health.asked == 0
    assert not notices(machine)


def test_failures_while_unwell_use_up_no_recovery(health):
    script = [fails_unwell(health)] * 4
    machine = watched(Scripted(*script), health=health, settings=dict(SETTINGS, max_recoveries=4))
    heals_at_once(machine, health)
    assert machine.run() == 'done'
    assert machine.visits() == ['A'] * 5
    assert not machine.of(EventKind.FAILURE) and machine.rate('A').recoveries == 0
    assert len(machine.of(EventKind.HEALTH_WAIT_START)) == 4


def test_a_failure_after_one_that_was_not_counted_is_not_continuous(health):
    machine = watched(Scripted(fails_unwell(health), 'aborted'), health=health, settings=SETTINGS)
    run = in_thread(machine.run)
    assert healthy_again(machine, health, run) == 'done'
    assert [event.continuous for event in machine.of(EventKind.FAILURE)] == [False]


def test_userdata_is_what_it_was_when_the_state_was_entered(health):
    def writes(state, ud):
        ud.count = 2
        return fails_unwell(health)(state, ud)

    seen = []

    def reads(state, ud):
        seen.append(ud.count)
        return 'ok'

    machine = watched(Scripted(writes, reads, io_keys=['count']), health=health, settings=SETTINGS)
    machine.machine.userdata.count = 1
    run = in_thread(machine.run)
    assert healthy_again(machine, health, run) == 'done'
    assert seen == [1]
    assert contents(machine.machine.userdata) == {'count': 1}


def both_branches_wait(health, log):
    """A machine in whose Concurrence both branches failed while unwell, and its run."""
    both = threading.Barrier(2)

    def fails(state, ud):
        health.now = 'battery: low'
        both.wait(10)
        return 'aborted'

    split = smach.Concurrence(
        outcomes=['done', 'aborted'],
        default_outcome='aborted',
        outcome_map={'done': {'RIGHT': 'done'}},
    )
    with split:
        smach.Concurrence.add('LEFT', chain_of(Scripted(fails)))
        smach.Concurrence.add('RIGHT', chain_of(Scripted(fails)))
    outer = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with outer:
        smach.StateMachine.add('SPLIT', split)
    machine = Watched(outer, health=health, settings=SETTINGS)
    run = in_thread(machine.run)
    assert wait_for(lambda: [text for _, text in log if text.endswith('; it waits, too')], 10)
    return machine, run


def test_one_notice_stands_for_all_branches_and_levels(health, log):
    machine, run = both_branches_wait(health, log)
    assert healthy_again(machine, health, run) == 'done'
    start, end = notices(machine)
    assert end.data['states'] == ['SM_ROOT/SPLIT/LEFT/A', 'SM_ROOT/SPLIT/RIGHT/A']
    assert not machine.of(EventKind.FAILURE)
    assert len([text for level, text in log if level == 'warn']) == 1


def test_a_branch_that_waits_no_more_leaves_the_other_waiting(health, log):
    machine, run = both_branches_wait(health, log)
    left = 'SM_ROOT/SPLIT/LEFT'
    machine.machine['SPLIT']['LEFT'].request_preempt()
    ends = (EventKind.CONTAINER_END,)
    assert wait_for(lambda: [each for each in machine.of(*ends) if each.path == left], 10)
    assert [each.kind for each in notices(machine)] == [EventKind.HEALTH_WAIT_START]
    assert healthy_again(machine, health, run) == 'done'
    assert [each.outcome for each in notices(machine)] == ['', 'well']


def test_a_wait_ends_once_health_has_been_good_for_the_settle_time(health):
    health.said = ['off', ''] * 8 + ['off']
    machine = watched(Scripted('aborted'), health=health, settings={'health_settle_s': 0.3})
    assert machine.run() == 'done'
    assert len(notices(machine)) == 2 and not health.said
    assert health.asked > 17


@pytest.mark.parametrize(
    'outcomes, ends',
    [(('done', 'aborted', 'preempted'), 'preempted'), (('done', 'aborted'), 'aborted')],
)
def test_a_preempt_ends_the_wait(health, outcomes, ends):
    failing = Scripted(fails_unwell(health), outcomes=('ok',) + outcomes[1:])
    machine = watched(failing, outcomes=outcomes, health=health, settings=SETTINGS)
    run = in_thread(machine.run)
    awaits(machine)
    machine.machine.request_preempt()
    assert run.result() == ends
    assert machine.machine.preempt_requested() is False
    assert machine.machine['A'].preempt_requested() is False
    assert notices(machine)[-1].outcome == 'stopped'
    assert notices(machine)[-1].text.startswith('the wait for the robot to be well was ended after')
    assert not machine.of(EventKind.FAILURE)
    health.now = ''
    assert machine.run() == 'done'


def test_a_preempt_while_it_is_looked_for_health_ends_the_machine():
    looking = threading.Event()

    def look():
        looking.set()
        return True

    machine = watched(Scripted('aborted'), health=look, settings={'health_settle_s': 30})
    run = in_thread(machine.run)
    assert looking.wait(10)
    machine.machine.request_preempt()
    assert run.result() == 'preempted'
    assert machine.machine['A'].preempt_requested() is False
    assert not machine.of(EventKind.FAILURE)
    assert machine.rate('A').failures == 0


def test_a_shutdown_ends_the_wait(health, monkeypatch):
    machine = watched(Scripted(fails_unwell(health)), health=health, settings=SETTINGS)
    run = in_thread(machine.run)
    awaits(machine)
    monkeypatch.setattr(smach, 'is_shutdown', lambda: True)
    assert run.result() == 'preempted'


def test_ctrl_c_ends_the_wait(health):
    machine = watched(Scripted(fails_unwell(health)), health=health, settings=SETTINGS)
    watch = machine.machine._oracle.tree.health
    real = watch.why_unwell

    def look(stopped, since_s=None):
        if notices(machine):
            raise KeyboardInterrupt
        return real(stopped, since_s)

    watch.why_unwell = look
    with pytest.raises(KeyboardInterrupt):
        machine.run()
    assert notices(machine)[-1].outcome == 'stopped'
    assert machine.machine.is_running() is False


def answered_while_unwell(health):
    """A machine that waits, since the robot was no longer well when the expert answered."""

    def answers(question, cancelled, progress):
        health.now = 'run-stop'
        return goto('B')

    machine = watched(
        Scripted('aborted'),
        Scripted(),
        health=health,
        expert=FakeExpert(answers),
        settings=dict(SETTINGS, max_recoveries=0),
    )
    run = in_thread(machine.run)
    awaits(machine)
    return machine, run


def test_an_experts_answer_is_carried_out_once_the_robot_is_well(health):
    machine, run = answered_while_unwell(health)
    assert not machine.of(EventKind.JUMP)
    assert healthy_again(machine, health, run) == 'done'
    kinds = machine.kinds()
    assert kinds.index('HEALTH_WAIT_END') < kinds.index('JUMP')
    assert machine.visits() == ['A', 'B']
    assert machine.rate('A').failures == 1


def test_a_preempt_in_the_wait_before_a_jump_ends_the_machine(health):
    machine, run = answered_while_unwell(health)
    machine.machine.request_preempt()
    assert run.result() == 'preempted'
    assert machine.visits() == ['A']


def test_the_policys_own_jump_waits(health, log):
    machine = watched(Scripted('aborted'), health=health, settings=SETTINGS)

    def decided(event):
        if event.kind is EventKind.DECISION:
            health.now = 'run-stop'

    machine.machine.events.observers.append(decided)
    run = in_thread(machine.run)
    assert healthy_again(machine, health, run) == 'done'
    assert machine.rate('A').recoveries == 1
    assert [text for level, text in log if 'not well' in text] == [
        'SM_ROOT/A is left for A while the robot is not well (FakeHealth: run-stop): waiting'
    ]


def test_an_open_question_stays_open(health):
    asked = threading.Event()
    go = threading.Event()

    def answers(question, cancelled, progress):
        asked.set()
        assert go.wait(10)
        return None if cancelled.is_set() else supersede('ok')

    machine = watched(
        Scripted('aborted'),
        health=health,
        expert=FakeExpert(answers),
        settings=dict(SETTINGS, max_recoveries=0, deadline_s=0),
    )
    run = in_thread(machine.run)
    assert asked.wait(10)
    health.now = 'run-stop'
    assert not machine.of(EventKind.QUERY_CANCELLED)
    go.set()
    assert run.result() == 'done'
    assert not notices(machine)


def test_a_precondition_that_was_not_met_while_unwell_is_not_judged(health, log):
    calls = []

    def check(userdata):
        calls.append(len(calls))
        if len(calls) == 1:
            health.now = 'motors: off'
            return False
        return True

    machine = watched(
        Scripted('aborted'), health=health, settings=SETTINGS, preconditions={'A': [check]}
    )
    run = in_thread(machine.run)
    assert healthy_again(machine, health, run) == 'done'
    ends = machine.of(EventKind.PRECONDITION_END)
    assert [event.outcome for event in ends] == ['met'] and len(calls) == 2
    assert [text for level, text in log if 'not well' in text] == [
        'SM_ROOT/A did not get its precondition check while the robot is not well '
        '(FakeHealth: motors: off): waiting'
    ]


def test_an_authors_own_recovery_goes_on_and_is_not_counted(health):
    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add(
            'DRIVE', Scripted(fails_unwell(health)), {'ok': 'done', 'aborted': 'ENABLE'}
        )
        smach.StateMachine.add(
            'ENABLE',
            Scripted(lambda state, ud: setattr(health, 'now', '') or 'ok'),
            {'ok': 'DRIVE'},
        )
    machine = Watched(machine, health=health, settings=SETTINGS)
    assert machine.run() == 'done'
    assert machine.visits() == ['DRIVE', 'ENABLE', 'DRIVE']
    assert not machine.of(EventKind.FAILURE) and not notices(machine)
    assert machine.of(EventKind.TRANSITION)[0].data == {'not_counted': True}
    row = machine.rate('DRIVE')
    assert (row.successes, row.failures) == (1, 0)


def test_without_recovery_nothing_waits(health):
    machine = watched(
        Scripted(fails_unwell(health)), health=health, settings=SETTINGS, recover=False
    )
    assert machine.run() == 'aborted'
    assert health.asked == 0


def test_the_time_limit_around_a_wait_stands_still(health):
    outer = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with outer:
        smach.StateMachine.add('X', chain_of(Scripted(fails_unwell(health))))
    machine = Watched(
        outer, health=health, settings=dict(SETTINGS, states={'X': {'time_limit_s': 0.3}})
    )
    run = in_thread(machine.run)
    awaits(machine)
    assert stays(lambda: not machine.of(EventKind.FAILURE, EventKind.PREEMPT), 1.0)
    health.now = ''
    assert run.result() == 'done'
    assert not machine.of(EventKind.FAILURE, EventKind.PREEMPT)


def test_a_nested_machine_holds_and_nobody_above_hears_of_a_failure(health):
    outer = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with outer:
        smach.StateMachine.add('X', chain_of(Scripted(), Scripted(fails_unwell(health))))
    machine = Watched(outer, health=health, settings=SETTINGS)
    run = in_thread(machine.run)
    assert healthy_again(machine, health, run) == 'done'
    assert machine.visits() == ['X', 'A', 'B', 'B']
    assert [event.path for event in notices(machine)] == ['SM_ROOT/X', 'SM_ROOT/X']


def test_a_state_that_runs_while_the_robot_is_unwell_is_not_disturbed(health):
    gate = Gate()
    machine = watched(Scripted(gate), health=health, settings=SETTINGS, expert=FakeExpert(waits))
    run = in_thread(machine.run)
    assert gate.entered.wait(10)
    health.now = 'run-stop'
    gate.go.set()
    assert run.result() == 'done'
    assert health.asked == 0


def test_who_fails_while_another_branch_waits_for_a_well_robot_waits_too(health, log):
    waiting = threading.Event()
    split = smach.Concurrence(
        outcomes=['done', 'aborted'],
        default_outcome='aborted',
        outcome_map={'done': {'LEFT': 'done', 'RIGHT': 'done'}},
    )
    with split:
        smach.Concurrence.add('LEFT', chain_of(Scripted(fails_unwell(health))))
        later = Scripted(lambda state, ud: 'aborted' if waiting.wait(10) else 'ok')
        smach.Concurrence.add('RIGHT', chain_of(later))
    machine = Watched(chain_of(split), health=health, settings=SETTINGS)
    machine.machine.events.observers.append(
        lambda event: waiting.set() if event.kind is EventKind.HEALTH_WAIT_START else None
    )
    run = in_thread(machine.run)
    assert wait_for(lambda: [text for _, text in log if text.endswith('; it waits, too')], 10)
    health.now = ''
    assert run.result() == 'done' and not machine.of(EventKind.FAILURE)
    assert later.runs == 2


def test_nobody_is_asked_any_more_once_the_machine_is_only_observed():
    health = FakeHealth()
    machine = watched(Scripted('aborted', 'ok', 'aborted'), health=health)
    assert machine.run() == 'done' and health.asked
    health.asked = 0
    smach_machine = machine.machine
    OracleContainer.wrap(smach_machine, recover=False)
    assert machine.run() == 'aborted' and not health.asked
