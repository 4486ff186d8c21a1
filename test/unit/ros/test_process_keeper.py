"""The keeper of a command leaves nothing of it behind, whichever process ends."""

import os
import shutil
import signal
import subprocess
import sys

import pytest
from waiting import wait_for

from smach_oracle.ros.interfaces import process_keeper
from smach_oracle.ros.interfaces.process_keeper import descendants

KEEPER = [sys.executable, '-I', process_keeper.__file__, '1', '0.5']
STUBBORN = """
import os, signal, subprocess, sys, time
for number in (signal.SIGINT, signal.SIGTERM):
    signal.signal(number, signal.SIG_IGN)
if len(sys.argv) < 2:  # a child that leaves, with a session of its own
    subprocess.Popen([sys.executable, __file__, 'child'], start_new_session=True)
print('up', os.getpid(), flush=True)
time.sleep(600)
"""


@pytest.fixture
def stubborn(tmp_path):
    path = tmp_path / 'stubborn.py'
    path.write_text(STUBBORN)
    return [sys.executable, str(path)]


def begin(command, **options):
    return subprocess.Popen(
        KEEPER + command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, **options
    )


def two_pids(stream):
    """The command and its child, once both are up."""
    return [int(stream.readline().split()[1]) for _ in range(2)]


def all_gone(pids, limit_s=20.0):
    return wait_for(
        lambda: not any(os.path.exists('/proc/{}'.format(pid)) for pid in pids), limit_s
    )


def test_what_ignores_every_signal_is_gone_when_the_pipe_closes(stubborn):
    keeper = begin(stubborn)
    pids = two_pids(keeper.stdout)
    assert sorted(descendants(keeper.pid)) == sorted(pids)
    keeper.stdin.close()
    assert keeper.wait(20) == 0
    assert all_gone(pids, 0.0), 'before the keeper itself'


def test_it_is_asked_to_end_before_it_is_forced(tmp_path):
    keeper = begin(
        [
            'sh',
            '-c',
            'trap "echo in order > {}; exit" INT; echo up; while :; do sleep 0.05; done'.format(
                tmp_path / 'end'
            ),
        ]
    )
    assert keeper.stdout.readline() == 'up\n'
    keeper.stdin.close()
    keeper.wait(20)
    assert (tmp_path / 'end').read_text() == 'in order\n'


@pytest.mark.parametrize('number', [signal.SIGKILL, signal.SIGTERM])
def test_nothing_is_left_when_whoever_started_it_is_killed(stubborn, number):
    parent = subprocess.Popen(
        [
            sys.executable,
            '-c',
            'import subprocess, sys, time; subprocess.Popen(sys.argv[1:], '
            'stdin=subprocess.PIPE, start_new_session=True); time.sleep(600)',
            *KEEPER,
            *stubborn,
        ],
        stdout=subprocess.PIPE,
        text=True,
    )
    pids = two_pids(parent.stdout)
    parent.send_signal(number)
    parent.wait(10)
    assert all_gone(pids)


def test_a_command_that_ends_by_itself_takes_its_children_along_and_its_exit_code_is_told(tmp_path):
    keeper = begin(['sh', '-c', 'setsid sleep 600 & echo $!; exit 3'])
    child = int(keeper.stdout.readline())
    assert keeper.wait(20) == 3
    assert all_gone([child])


def test_a_command_that_is_not_there_is_named():
    keeper = begin(['/no/such/command'])
    assert '/no/such/command' in keeper.stdout.readline()
    assert keeper.wait(20) == 127


def test_a_name_that_is_cut_within_a_letter_hides_nothing(tmp_path):
    program = str(tmp_path / ('é' * 10))  # the system keeps 15 bytes of it
    shutil.copy(shutil.which('sleep'), program)
    keeper = begin([program, '600'])
    try:
        wait_for(lambda: names_of(keeper.pid), 20.0)
        assert names_of(keeper.pid) == [b'(' + 'é'.encode() * 7 + 'é'.encode()[:1] + b')']
    finally:
        keeper.stdin.close()
        assert keeper.wait(20) == 0


def names_of(root):
    """As the system has them, of those that run a program of their own."""
    found = []
    for pid in descendants(root):
        with open('/proc/{}/stat'.format(pid), 'rb') as file:
            found.append(file.read().split()[1])
    return [name for name in found if name.startswith('(é'.encode())]
