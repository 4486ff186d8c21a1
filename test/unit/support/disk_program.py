"""Run in a folder that is a small disk: does a machine with a store there do as it should?"""

import os
import signal
import subprocess
import sys

from killed_machines import in_a_process
from waiting import wait_for

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.errors import CheckpointError

FILLER = 'filler'


class Does(smach.State):
    """Calls something, and writes 5 kB."""

    def __init__(self, call):
        smach.State.__init__(self, ['succeeded'], ['done'], ['done', 'large'])
        self._call = call

    def execute(self, userdata):
        userdata.done = list(userdata.done) + [len(userdata.done)]
        userdata.large = '{}'.format(len(userdata.done)) * 5000
        self._call()
        return 'succeeded'


def machine_of(calls):
    machine = smach.StateMachine(['succeeded'])
    machine.userdata.done = []
    with machine:
        for number, call in enumerate(calls):
            smach.StateMachine.add(
                'S{}'.format(number),
                Does(call),
                {'succeeded': 'S{}'.format(number + 1) if number + 1 < len(calls) else 'succeeded'},
            )
    return OracleContainer.wrap(
        machine, name='TOP', settings={'checkpoint': 'robot.db', 'on_resume': 'recover'}
    )


def nothing():
    pass


def full():
    log = []

    def fill():
        with open(FILLER, 'wb', buffering=0) as stream:
            try:
                while True:
                    stream.write(bytes(1000))
            except OSError as err:
                assert 'No space left' in str(err)

    def free():
        said = [text for text in log if 'The machine goes on' in text]
        assert len(said) == 1 and 'full' in said[0], log
        os.remove(FILLER)
        assert wait_for(lambda: any('all is stored again' in text for text in log)), log

    def work():
        smach.set_loggers(*[lambda text: None, log.append] * 2)
        return machine_of(
            [nothing, fill, nothing, nothing, free, lambda: os.kill(os.getpid(), signal.SIGKILL)]
        ).execute()

    told = in_a_process(work)
    assert told is None, told
    resumed = machine_of([nothing] * 6)
    assert resumed.execute() == 'succeeded'
    assert resumed.userdata.done == list(range(6)), resumed.userdata.done


def read_only():
    assert in_a_process(lambda: machine_of([nothing]).execute()) == 'succeeded'
    subprocess.check_call(['mount', '-o', 'remount,ro', os.getcwd()])
    ran = []
    try:
        machine_of([lambda: ran.append(1)]).execute()
    except CheckpointError as err:
        assert 'robot.db' in str(err) and 'ead-only' in str(err), err
        assert not ran
    else:
        raise AssertionError('nothing was said')


if __name__ == '__main__':
    {'full': full, 'read_only': read_only}[sys.argv[1]]()
    print('AS IT SHOULD BE')
