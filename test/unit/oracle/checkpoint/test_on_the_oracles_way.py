"""Killed as the oracle checks and achieves preconditions and tries again, a machine goes on."""

import os
import signal

import pytest
from killed_machines import Diary, KilledMachine, Noted, Points, around, in_a_process
from killed_trees import make
from left_stores import Left
from machines import FakeExpert, FakeWaiting, Watched, supersede

import smach
from smach_oracle.oracle import oracle_of

ENDS = {'succeeded': 'succeeded', 'aborted': 'aborted'}


class OnceFailing(Noted):
    """Fails the first time that it comes to its end, in whichever process."""

    def execute(self, userdata):
        outcome = super().execute(userdata)
        return 'aborted' if self._diary.count('ends')[self._name] == 1 else outcome


class Kitchen:
    """Builds LOOK, then PICK, which fails once and then wants an open hand and a clear view."""

    def __init__(self, opens):
        """`opens`: the precondition about the hand.

        The label OPEN, a pair that achieves it, or a function that has the name of the meta state.
        """
        self._opens = opens
        self.preconditions = []

    def __call__(self, diary, points):
        def is_clear(userdata):
            diary.write('begins', 'CLEAR')
            points()
            return True

        def is_open(userdata):
            points()
            return 'OPEN' in userdata.done

        def ORACLE(userdata):
            return is_open(userdata) or Noted('OPEN', diary, points).execute(userdata) != ''

        inner = smach.StateMachine(['succeeded', 'aborted'], ['done'], ['done'])
        with inner:
            smach.StateMachine.add('LOOK', Noted('LOOK', diary, points), {'succeeded': 'PICK'})
            smach.StateMachine.add('PICK', OnceFailing('PICK', diary, points), {'succeeded': 'PUT'})
            smach.StateMachine.add('PUT', Noted('PUT', diary, points), ENDS)
            smach.StateMachine.add('OPEN', Noted('OPEN', diary, points), {'succeeded': 'PICK'})
        machine = smach.StateMachine(['succeeded', 'aborted'])
        machine.userdata.done = []
        with machine:
            smach.StateMachine.add('KITCHEN', inner, ENDS)
        ways = {'label': 'OPEN', 'pair': {'check': is_open, 'achieve': 'OPEN'}, 'function': ORACLE}
        self.preconditions[:] = [ways[self._opens], is_clear]
        return machine


@pytest.mark.parametrize('opens', ['label', 'pair'])
def test_it_comes_to_its_end_and_only_what_was_under_way_runs_again(tmp_path, opens):
    build = Kitchen(opens)
    left = Left(build, states={'PICK': {'preconditions': build.preconditions}})
    told = left.told
    assert told['done'] == ['LOOK', 'PICK', 'OPEN', 'PICK', 'PUT']
    assert 'PRECONDITION_END' in [kind for kind, _, _ in told['events']]
    usual = dict(LOOK=1, PICK=2, OPEN=1, PUT=1)
    for point in left.points():
        killed = left.killed_at(point, tmp_path / 'killed')
        told = killed.run()
        assert told.get('outcome') == 'succeeded', (point, told)
        assert 'OPEN' in told['done'], (point, 'what a precondition has written is lost')
        begun, ended = killed.diary.count('begins'), killed.diary.count('ends')
        assert set(ended) == set(usual), (point, ended)
        assert all(begun[name] <= usual[name] + 1 for name in usual), (point, begun)


def test_what_a_precondition_has_written_is_kept_whatever_its_name(tmp_path):
    build = Kitchen('function')
    left = Left(build, states={'PICK': {'preconditions': build.preconditions}}, userdata='restore')
    killed = left.killed_at(left.first_in('CLEAR'), tmp_path / 'killed')
    assert killed.run()['done'] == ['LOOK', 'PICK', 'OPEN', 'PICK', 'PUT']


def test_a_branch_that_is_tried_again_has_not_ended_wherever_it_is_killed(tmp_path):
    """What the oracle decides of it leads to its label, which is no outcome."""

    def build(diary, points):
        both = smach.Concurrence(['succeeded', 'aborted'], 'succeeded', ['done'], ['done'])
        with both:
            smach.Concurrence.add('LEFT', OnceFailing('LEFT', diary, points))
            smach.Concurrence.add('RIGHT', Noted('RIGHT', diary, points))
        return around('BOTH', both, ENDS)

    left = Left(build)
    for point in left.points():
        killed = left.killed_at(point, tmp_path / 'killed')
        told = killed.run()
        assert told.get('outcome') == 'succeeded', (point, told)
        assert not [text for text in told['log'] if 'is not there any more' in text], point
        assert killed.diary.count('ends')['LEFT'] >= 2, point


def test_a_recovery_counts_once_where_it_was_killed_before_its_jump(tmp_path):
    def build(diary, points):
        return around('PICK', OnceFailing('PICK', diary, points), ENDS)

    killed = KilledMachine(make(tmp_path / 'killed'), build)

    def run(as_it_waits):
        settings = {
            'policy': {'name': 'ladder', 'wait_s': 5},
            'checkpoint': killed.store,
            'on_resume': 'recover',
        }
        machine = Watched(
            build(Diary(killed.diary._path), Points(0)), name='TOP', settings=settings
        )
        oracle_of(machine.machine).waiting = FakeWaiting(as_it_waits)
        outcome, spent = machine.run(), machine.machine._oracle.tree.spent()['budget'][0]
        return outcome, spent, machine.rate('PICK').recoveries

    assert in_a_process(lambda: run(lambda: os.kill(os.getpid(), signal.SIGKILL))) is None
    assert in_a_process(lambda: run(lambda: None)) == ['succeeded', 1, 1]


@pytest.mark.parametrize(
    'settings',
    [
        {'policy': {'name': 'step_back', 'times': 1}, 'tree': {'step_back_across': True}},
        {
            'policy': 'always_ask',
            'max_recoveries': 1,
            'expert': {'on_no_answer': {'goto': 'FIND'}},
        },
        {'policy': {'name': 'restart', 'times': 9}, 'max_recoveries': 1},
    ],
    ids=['step_back', 'goto', 'restart'],
)
def test_a_recovery_that_has_left_its_container_counts_after_a_crash(tmp_path, settings):
    def build(diary, points):
        pick = smach.StateMachine(['succeeded', 'aborted'], ['done'], ['done'])
        with pick:
            smach.StateMachine.add('GRASP', Noted('GRASP', diary, points, failures=9), ENDS)
        machine = smach.StateMachine(['succeeded', 'aborted'])
        machine.userdata.done = []
        with machine:
            smach.StateMachine.add('FIND', Noted('FIND', diary, points), {'succeeded': 'PICK'})
            smach.StateMachine.add('PICK', pick, ENDS)
        return machine

    whole = KilledMachine(make(tmp_path / 'whole'), build, **settings).run()
    assert whole['outcome'] == 'aborted'
    jumps = [seq for kind, seq, _ in whole['events'] if kind == 'JUMP']
    assert len(jumps) == 1

    killed = KilledMachine(make(tmp_path / 'killed'), build, **settings)
    starts = [event[1] for event in whole['events'] if event[0] == 'STATE_START']
    # FIND, PICK and GRASP have run, with two points in each state, and FIND has begun again
    assert killed.run(kill_at=4 + starts[3] + 2) is None
    assert killed.diary.count('begins') == {'FIND': 2, 'GRASP': 1}
    assert killed.run(on_resume='state:FIND')['outcome'] == 'aborted'
    assert killed.diary.count('begins') == {'FIND': 3, 'GRASP': 2}


def test_a_level_above_that_was_killed_as_it_decided_has_learned_of_no_failure(tmp_path):
    """GRASP fails, its oracle would ask, and that of PICK runs the precondition of PICK."""

    def build(diary, points):
        pick = smach.StateMachine(['succeeded', 'aborted'], ['done'], ['done'])
        with pick:
            smach.StateMachine.add('GRASP', Noted('GRASP', diary, points, failures=2), ENDS)
        return around('PICK', pick, ENDS)

    def is_near(userdata):
        killed.diary.write('begins', 'is_near')
        if killed.diary.count('begins')['is_near'] == 1:
            os.kill(os.getpid(), signal.SIGKILL)
        return True

    states = {'GRASP': {'prior': 0.5}, 'PICK': {'preconditions': [is_near]}}
    killed = KilledMachine(tmp_path, build, states=states, escalate=True, memory=1000)
    assert killed.run(expert=FakeExpert()) is None
    told = killed.run(expert=FakeExpert(supersede('succeeded')))
    assert told['outcome'] == 'succeeded'
    failures = [state for kind, _, state in told['events'] if kind == 'FAILURE']
    assert failures.count('PICK') == 2, 'of the program that was killed none was told'
    assert ['TOP', 'PICK', 1, 2] in told['rates']
