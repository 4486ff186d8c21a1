"""Branches at whose failure `child_termination_cb` has the others stop: they do so at once."""

import copy
import os
import threading

import pytest
from branch_machines import both, inside, iterator_over
from machines import (
    FakeExpert,
    FakeHealth,
    Gate,
    Scripted,
    Watched,
    chain_of,
    give_up,
    in_thread,
)

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.records.events import EventKind, FailureKind

ENDS = ('done', 'aborted', 'preempted')
NEVER = {'child_termination_cb': lambda ended: False}
BY_FAILURE = {'child_termination_cb': lambda ended: ended['LEFT'] == 'aborted'}
UPSTREAMS_WAY = pytest.mark.skipif(
    bool(os.environ.get('SMACH_UPSTREAM')),
    reason='upstream stops all at any list, and none where the callback raises',
)


class Bumper(Scripted):
    """Fails once the drive is under way."""

    def __init__(self, drive, *steps):
        super().__init__(*steps)
        self._drive = drive

    def execute(self, ud):
        if not self.runs:
            assert self._drive.entered.wait(20)
        return super().execute(ud)


def beside(*steps, **options):
    """LEFT takes these steps beside RIGHT, which drives until it is preempted."""
    gate = Gate()
    left, right = Bumper(gate, *steps), Scripted(gate)
    return left, right, both(left, right, **options)


def watched(concurrence, **wrap):
    return Watched(inside(concurrence), name='TOP', **wrap)


def failures(machine):
    return [(event.path, event.state) for event in machine.of(EventKind.FAILURE)]


def decisions(machine):
    return [(event.path, event.state) for event in machine.of(EventKind.DECISION)]


def test_the_others_stop_at_once_and_the_level_above_recovers():
    bumper, drive, concurrence = beside('aborted', **BY_FAILURE)
    machine = watched(concurrence)
    assert machine.run() == 'done'
    assert (bumper.runs, drive.runs) == (2, 2)
    assert failures(machine) == [('TOP/ALL', 'LEFT'), ('TOP', 'ALL')]
    assert decisions(machine) == [('TOP', 'ALL')]
    assert machine.rate('LEFT').failures == 1


def test_the_authors_transition_from_the_concurrence_is_next():
    bumper, drive, concurrence = beside('aborted', **BY_FAILURE)
    top = inside(concurrence, transitions={'done': 'done', 'aborted': 'BACK_OFF'})
    back_off = Scripted()
    with top:
        smach.StateMachine.add('BACK_OFF', back_off, {'ok': 'done'})
    machine = Watched(top, name='TOP')
    assert machine.run() == 'done'
    assert (bumper.runs, drive.runs, back_off.runs) == (1, 1, 1)
    assert not decisions(machine)


@pytest.mark.parametrize('answer', [True, 1, ['RIGHT'], ('RIGHT', 'LEFT'), {'RIGHT'}])
def test_all_that_has_the_engine_stop_others_counts(answer):
    bumper, drive, concurrence = beside(
        'aborted', child_termination_cb=lambda ended: ended['LEFT'] == 'aborted' and answer
    )
    assert watched(concurrence).run() == 'done'
    assert (bumper.runs, drive.runs) == (2, 2)


def test_it_is_asked_as_without_an_oracle_and_told_the_end_as_well():
    told = []
    left, right = Scripted('aborted'), Scripted(Gate())

    def ends(ended):
        told.append(dict(ended))
        return ended['LEFT'] == 'ok'

    machine = watched(both(left, right, default_outcome='done', child_termination_cb=ends))
    assert machine.run() == 'done'
    assert (left.runs, right.runs) == (2, 1)
    assert told == [
        {'LEFT': 'aborted', 'RIGHT': None},
        {'LEFT': 'ok', 'RIGHT': None},
        {'LEFT': 'ok', 'RIGHT': 'preempted'},
    ]
    assert decisions(machine) == [('TOP/ALL', 'LEFT')]


def test_what_the_callback_writes_into_its_map_changes_nothing():
    def ends(ended):
        if ended['LEFT'] == 'aborted':
            ended.clear()
        return False

    left, right = Scripted('aborted'), Scripted()
    assert watched(both(left, right, child_termination_cb=ends)).run() == 'done'
    assert (left.runs, right.runs) == (2, 1)


def test_the_last_one_that_runs_stops_nobody_and_is_recovered_in_its_place():
    right = Scripted()

    def after_the_other(state, ud):
        for _ in range(2000):
            if right.runs and concurrence.get_active_states() == ['LEFT']:
                return 'aborted'
            threading.Event().wait(0.01)
        raise AssertionError('RIGHT has not ended')

    left = Scripted(after_the_other)
    concurrence = both(left, right, **BY_FAILURE)
    machine = watched(concurrence)
    assert machine.run() == 'done'
    assert (left.runs, right.runs) == (2, 1)
    assert decisions(machine) == [('TOP/ALL', 'LEFT')]


@UPSTREAMS_WAY
def test_a_list_that_names_one_that_has_ended_stops_nobody():
    first, stopped = threading.Event(), Gate()

    def ends(ended):
        if ended['RIGHT']:
            first.set()
        return [label for label in ('RIGHT',) if ended['LEFT'] == 'aborted']

    def after_the_other(state, ud):
        assert first.wait(20)
        return 'aborted'

    left = Scripted(after_the_other)
    concurrence = both(left, Scripted(), default_outcome='done', child_termination_cb=ends)
    with concurrence:
        smach.Concurrence.add('THIRD', Scripted(stopped))
    machine = watched(concurrence)

    def lets_go():
        while left.runs < 2:
            threading.Event().wait(0.01)
        stopped.go.set()

    threading.Thread(target=lets_go, daemon=True).start()
    assert machine.run() == 'done'
    assert left.runs == 2


@pytest.mark.parametrize('steps', ['aborted', ValueError('dead')])
def test_override_has_it_recovered_in_its_place(steps):
    left, right = Scripted(steps), Scripted()
    machine = watched(
        both(left, right, **BY_FAILURE),
        settings={'states': {'ALL/LEFT': {'author_recoveries': 'override'}}},
    )
    assert machine.run() == 'done'
    assert (left.runs, right.runs) == (2, 1)


def test_an_error_stops_them_as_without_an_oracle():
    bumper, drive, concurrence = beside(ValueError('sensor is dead'), **BY_FAILURE)
    machine = watched(concurrence)
    assert machine.run() == 'done'
    assert (bumper.runs, drive.runs) == (2, 2)
    assert failures(machine) == [('TOP/ALL', 'LEFT'), ('TOP', 'ALL')]
    assert decisions(machine) == [('TOP', 'ALL')]
    above = machine.of(EventKind.FAILURE)[1]
    assert above.failure_kind == FailureKind.EXCEPTION


def test_the_question_about_the_level_above_says_what_a_branch_has_raised():
    bumper, _, concurrence = beside(ValueError('sensor is dead'), **BY_FAILURE)
    expert = FakeExpert(give_up())
    machine = watched(concurrence, expert=expert, settings={'max_recoveries': 0})
    with pytest.raises(smach.InvalidUserCodeError):
        machine.run()
    (question,) = expert.questions
    assert question.failed_state == 'ALL'
    assert '(LEFT failed: ValueError: sensor is dead)' in question.text
    assert bumper.runs == 1


def test_the_question_about_the_level_above_says_which_branch_has_failed():
    _, _, concurrence = beside('aborted', **BY_FAILURE)
    expert = FakeExpert(give_up())
    machine = watched(concurrence, expert=expert, settings={'max_recoveries': 0})
    assert machine.run() == 'aborted'
    (question,) = expert.questions
    assert (question.failed_state, question.text) == ('ALL', 'LEFT failed: aborted')


def test_the_level_above_says_which_branch_in_an_iterator_has_failed():
    _, _, concurrence = beside('aborted', **BY_FAILURE)
    machine = watched(iterator_over(concurrence, items=(1, 2), loop_outcomes=['done']))
    assert machine.run() == 'done'
    (above,) = [event for event in machine.of(EventKind.FAILURE) if event.path == 'TOP']
    assert above.text == 'EACH/LEFT failed: aborted (item 1 of 2)'


@pytest.mark.skipif(
    bool(os.environ.get('SMACH_UPSTREAM')), reason="upstream's Concurrence holds a lock"
)
def test_a_machine_whose_branch_has_raised_can_be_copied():
    class Held(Exception):
        def __init__(self):
            super().__init__()
            self.lock = threading.Lock()

    concurrence = both(Scripted(Held()), Scripted())
    machine = OracleContainer.wrap(inside(concurrence), settings={'max_recoveries': 0})
    with pytest.raises(smach.InvalidUserCodeError):
        machine.execute()
    assert copy.deepcopy(machine).execute() == 'done'


def test_an_error_is_recovered_in_its_place_where_no_callback_is_given():
    left, right = Scripted(ValueError('slipped')), Scripted()
    assert watched(both(left, right)).run() == 'done'
    assert (left.runs, right.runs) == (2, 1)


@UPSTREAMS_WAY
def test_a_callback_that_raises_raises_as_without_an_oracle():
    def ends(ended):
        if ended['LEFT'] == 'aborted':
            raise KeyError('no such branch')
        return False

    bumper, drive, concurrence = beside('aborted', child_termination_cb=ends)
    machine = watched(concurrence)
    assert machine.run() == 'done'
    assert (bumper.runs, drive.runs) == (2, 2)
    assert decisions(machine) == [('TOP', 'ALL')]


@UPSTREAMS_WAY
def test_a_callback_that_would_end_the_program_raises_as_without_an_oracle():
    def ends(ended):
        if ended['LEFT'] == 'aborted':
            raise SystemExit(3)
        return False

    bumper, drive, concurrence = beside('aborted', child_termination_cb=ends)
    machine = watched(concurrence)
    assert machine.run() == 'done'
    assert (bumper.runs, drive.runs) == (2, 2)


def test_callbacks_of_two_branches_that_fail_at_once_may_preempt_them_all():
    """In the callback of one the other one is preempted, while it is in its own."""
    both_ask = threading.Barrier(2)

    def ends(ended):
        if 'aborted' in ended.values() and not concurrence.preempt_requested():
            both_ask.wait(20)
            concurrence.request_preempt()
        return False

    concurrence = both(
        Scripted('aborted'), Scripted('aborted'), outcome_map={}, child_termination_cb=ends
    )
    machine = watched(concurrence)
    assert in_thread(machine.run).result()


def test_they_stop_before_anybody_looks_whether_the_robot_is_well():
    health, asked = FakeHealth(), []
    drives = Gate()

    def stops(state, ud):
        outcome = drives(state, ud)
        asked.append(health.asked)
        return outcome

    bumper, drive = Bumper(drives, 'aborted'), Scripted(stops)
    machine = watched(both(bumper, drive, **BY_FAILURE), health=health)
    assert machine.run() == 'done'
    assert asked == [0] and health.asked
    assert failures(machine) == [('TOP/ALL', 'LEFT'), ('TOP', 'ALL')]


def test_the_level_above_counts_no_failure_of_a_robot_that_is_not_well():
    health = FakeHealth('the motors are off')
    bumper, drive, concurrence = beside('aborted', **BY_FAILURE)
    machine = watched(concurrence, health=health, settings={'healthy': {'settle_s': 0.01}})
    assert machine.run() == 'done'
    assert (bumper.runs, drive.runs) == (2, 2)
    assert failures(machine) == [('TOP/ALL', 'LEFT')]
    assert machine.of(EventKind.HEALTH_WAIT_END)


def test_an_overrun_is_recovered_in_its_place():
    left = Scripted(Gate())
    machine = watched(
        both(left, Scripted(), child_termination_cb=lambda ended: False),
        settings={'states': {'ALL/LEFT': {'time_limit_s': 0.05}}},
    )
    assert machine.run() == 'done'
    assert decisions(machine) == [('TOP/ALL', 'LEFT')]


def test_a_machine_beside_others_is_recovered_inside():
    inner = Scripted('aborted')
    machine = watched(
        both(
            chain_of(inner, outcomes=('done', 'aborted', 'preempted')),
            Scripted(),
            outcome_map={'done': {'LEFT': 'done', 'RIGHT': 'ok'}},
            **BY_FAILURE,
        )
    )
    assert machine.run() == 'done'
    assert inner.runs == 2


def watching(state, outcomes=('aborted', 'preempted')):
    """A machine that looks again and again, and ends as something is wrong."""
    machine = smach.StateMachine(outcomes=list(outcomes))
    with machine:
        smach.StateMachine.add('LOOK', Scripted(), {'ok': 'CHECK'})
        smach.StateMachine.add('CHECK', state, {'ok': 'LOOK'})
    return machine


@pytest.mark.parametrize('step', ['aborted', ValueError('dead')])
def test_a_machine_that_only_watches_stops_them_as_well(step):
    gate = Gate()
    check, drive = Bumper(gate, step, 'preempted'), Scripted(gate)
    machine = watched(
        both(watching(check, ENDS), drive, outcome_map={'done': {'RIGHT': 'ok'}}, **BY_FAILURE)
    )
    assert machine.run() == 'done'
    assert (check.runs, drive.runs) == (2, 2)
    assert failures(machine) == [('TOP/ALL/LEFT', 'CHECK'), ('TOP', 'ALL')]
    assert 'LEFT/CHECK failed: ' in machine.of(EventKind.FAILURE)[1].text
    assert decisions(machine) == [('TOP', 'ALL')]


def test_a_machine_that_watches_is_recovered_inside_where_nothing_stops():
    check = Scripted('aborted', 'preempted')
    concurrence = both(
        watching(check, ENDS), Scripted(), default_outcome='done', outcome_map={}, **NEVER
    )
    machine = watched(concurrence)
    assert machine.run() == 'done'
    assert check.runs == 2
    assert decisions(machine) == [('TOP/ALL/LEFT', 'CHECK')]


def test_a_branch_that_raises_as_it_is_tried_again_ends_as_it_had_failed():
    left, right = Scripted('aborted', ValueError('the list is empty')), Scripted(Gate())
    machine = watched(
        both(left, right, default_outcome='done', child_termination_cb=ends_by_aborted_twice()),
        settings={'states': {'ALL/LEFT': {'max_recoveries': 1}}},
    )
    assert machine.run() == 'done'
    assert left.runs == 2
    assert not [event for event in machine.of(EventKind.FAILURE) if event.path == 'TOP']


def ends_by_aborted_twice():
    """A callback that has the others stop as LEFT ends, and not as it fails first."""
    told = []

    def ends(ended):
        told.append(ended['LEFT'])
        return told.count('aborted') == 2

    return ends


def test_a_machine_that_guards_others_stops_them_where_its_end_is_intended():
    gate = Gate()
    check, drive = Bumper(gate, 'aborted'), Scripted(gate)
    machine = watched(
        both(chain_of(check, outcomes=('done', 'aborted', 'preempted')), drive, **BY_FAILURE),
        settings={'states': {'ALL/LEFT/A': {'intended_outcomes': ['aborted']}}},
    )
    assert machine.run() == 'aborted'
    assert (check.runs, drive.runs) == (1, 1)
