"""Goals that a killed program has left running are ended before anything is sent."""

import contextlib
import os
import signal

from killed_machines import KilledMachine, Noted
from killed_trees import ENDS
from test_never_twice import moment_of

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.records.running_goals import GOALS
from smach_oracle.store.store_file import StoreFile


class Sends(Noted):
    """Sends a goal. The first two processes are killed while that runs."""

    def execute(self, userdata):
        GOALS.begin('reach', '/arm')
        self._diary.write('sends', self._name)
        if self._diary.count('sends')[self._name] <= 2:
            os.kill(os.getpid(), signal.SIGKILL)
        GOALS.end('reach')
        return Noted.execute(self, userdata)


def sending(diary, points):
    def end_goals(goals, must_stop):
        assert not must_stop()
        for goal_id, server in goals.items():
            diary.write('ends', '{} of {}'.format(goal_id, server))
        return {'reach': '/arm'}

    GOALS.end_goals = end_goals
    machine = smach.StateMachine([*ENDS])
    machine.userdata.done = []
    with machine:
        smach.StateMachine.add('A', Sends('A', diary, points), {'succeeded': 'B'})
        smach.StateMachine.add('B', Noted('B', diary, points), ENDS)
    return machine


def test_what_still_runs_is_ended_and_what_may_run_on_is_told(tmp_path):
    killed = KilledMachine(tmp_path, sending)
    assert killed.run() is None
    assert killed.diary.count('ends') == {}
    assert killed.run() is None, 'it goes on, and is killed again'
    assert killed.diary.count('ends') == {'reach of /arm': 1}
    told = killed.run()
    assert (told['outcome'], killed.diary.count('ends')['reach of /arm']) == ('succeeded', 2)
    log = '\n'.join(told['log'])
    assert 'TOP: the program was killed while a goal of /arm ran: cancelled, and waited for' in log
    assert 'TOP: a goal of /arm may still run' in log


def test_a_goal_that_runs_as_a_trial_begins_is_stored_too(tmp_path):
    """It was sent before the machine began, such as by the script itself."""

    def sent_before(diary, points):
        if not diary.count('sends'):
            GOALS.keep('lift', '/torso')
        return sending(diary, points)

    killed = KilledMachine(tmp_path, sent_before)
    assert killed.run() is None
    assert killed.run() is None
    assert killed.diary.count('ends') == {'lift of /torso': 1, 'reach of /arm': 1}


def test_a_goal_that_was_sent_behind_the_moment_that_it_goes_on_from_is_ended_too(tmp_path):
    killed = KilledMachine(tmp_path, sending)
    assert killed.run() is None
    assert killed.run(resume_from=moment_of(killed, 'STATE_START', 'A')) is None
    assert killed.diary.count('ends') == {'reach of /arm': 1}


def test_a_goal_that_has_ended_when_the_next_state_begins_is_forgotten(tmp_path):
    class EndsFirst(Noted):
        def execute(self, userdata):
            GOALS.begin('look', '/camera')
            GOALS.end('look')
            return Noted.execute(self, userdata)

    def ending(diary, points):
        machine = sending(diary, points)
        with machine:
            first = EndsFirst('FIRST', diary, points)
            smach.StateMachine.add('FIRST', first, {'succeeded': 'A', 'aborted': 'aborted'})
        machine.set_initial_state(['FIRST'])
        return machine

    killed = KilledMachine(tmp_path, ending)
    assert killed.run() is None
    assert killed.run() is None
    assert killed.diary.count('ends')['look of /camera'] == 0
    assert killed.diary.count('ends')['reach of /arm'] == 1


def twice(does):
    """A machine of A and B, each of which does the same."""
    machine = smach.StateMachine(['succeeded'])
    with machine:
        for label, following in (('A', 'B'), ('B', 'succeeded')):
            state = smach.CBState(does, outcomes=['succeeded'])
            smach.StateMachine.add(label, state, {'succeeded': following})
    return machine


def facts_of(goal, path, trial=1):
    """What the store of a machine says of a goal."""
    with contextlib.closing(StoreFile(path, read_only=True)) as store:
        return [each for each in store.facts(trial) if each.name == 'goal:' + goal]


def test_a_goal_is_stored_as_it_is_sent_and_once_it_has_ended(tmp_path):
    def sends(userdata):
        GOALS.begin('look', '/camera')
        GOALS.end('look')
        return 'succeeded'

    machine = twice(sends)
    path = str(tmp_path / 'robot.db')
    for _ in range(2):
        OracleContainer.wrap(machine, settings={'checkpoint': path}).execute()
    for trial in (1, 2):
        facts = facts_of('look', path, trial)
        assert [(each.kind, each.value.text) for each in facts] == [
            ('GOAL', '"/camera"'),
            ('STATE_START', None),
            ('GOAL', '"/camera"'),
            ('TRIAL_END', None),
        ]


def test_a_goal_that_runs_as_a_trial_begins_is_stored_until_it_has_ended(tmp_path, log):
    def ends(userdata):
        GOALS.end('lift')
        return 'succeeded'

    machine = twice(ends)
    path = str(tmp_path / 'robot.db')
    GOALS.keep('lift', '/torso')
    OracleContainer.wrap(machine, settings={'checkpoint': path}).execute()
    GOALS.begin('after', '/torso')
    GOALS.end('after')
    assert not [text for level, text in log if level in ('warn', 'err')], 'nobody stores it'
    facts = facts_of('lift', path)
    assert [(each.kind, each.label, each.value.text) for each in facts] == [
        ('TRIAL_START', '', '"/torso"'),
        ('STATE_START', 'B', None),
    ]
