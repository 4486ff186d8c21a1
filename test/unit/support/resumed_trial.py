"""A trial whose program was stopped, and that another program went on with: it is in two bags."""

import contextlib

import pytest

import smach
from smach_oracle.oracle import OracleContainer, oracle_of
from smach_oracle.ros.recorder import TrialRecorder


class NoWait:
    """Takes no time."""

    def wait(self, seconds, what, scope):
        pass


class FailsOnce(smach.State):
    def __init__(self):
        super().__init__(outcomes=['succeeded', 'aborted'])
        self.has_failed = False

    def execute(self, userdata):
        failed, self.has_failed = self.has_failed, True
        return 'succeeded' if failed else 'aborted'


class Carries(smach.State):
    def __init__(self, stops):
        super().__init__(outcomes=['succeeded'])
        self.stops = stops

    def execute(self, userdata):
        if self.stops:
            raise KeyboardInterrupt
        return 'succeeded'


def record_resumed_trial(folder):
    """Record it into a sub-folder, which is returned. GRASP fails in the first program.

    It is stopped in CARRY. PLACE fails in the second one, and the trial succeeds.
    """
    for stops in (True, False):
        machine = smach.StateMachine(outcomes=['succeeded', 'aborted'])
        with machine:
            smach.StateMachine.add('GRASP', FailsOnce(), {'succeeded': 'CARRY'})
            smach.StateMachine.add('CARRY', Carries(stops), {'succeeded': 'PLACE'})
            smach.StateMachine.add('PLACE', FailsOnce())
        store = {'file': str(folder / 'robot.db'), 'on_resume': 'recover'}
        OracleContainer.wrap(
            machine, name='TOP', settings={'policy': 'escalating', 'checkpoint': store}
        )
        oracle_of(machine).waiting = NoWait()
        recorder = TrialRecorder(str(folder / 'bags'), warn=pytest.fail)
        recorder.attach(oracle_of(machine))
        with contextlib.suppress(KeyboardInterrupt):
            machine.execute()
        assert recorder.close(20.0)
    assert len(list((folder / 'bags').glob('*.bag'))) == 2
    return folder / 'bags'
