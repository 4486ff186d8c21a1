"""A script that starts processes, and ends them, runs under oracle_run as it runs by itself.

Its children touch nothing of it. Real processes, real signals.
"""

import fcntl
import json
import os
import re
import signal
import sqlite3
import subprocess
import sys
import textwrap
from pathlib import Path

import forking_script
import pytest
import rosbag
from waiting import wait_for

RUNNER = 'from smach_oracle.ros.oracle_run.script_runner import main; main()'
SCRIPT = str(Path(forking_script.__file__))
ENVIRONMENT = dict(os.environ, ROS_MASTER_URI='http://localhost:1')  # nobody is there


def run(*command):
    return subprocess.run(
        [sys.executable, *command],
        env=ENVIRONMENT,
        timeout=60,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        universal_newlines=True,
    )


def said(process):
    return re.findall('SAID .*', process.stdout), process.returncode


def first_said(program):
    """The next that a program says, the lines of SMACH's log left out."""
    for line in program.stdout:
        if line.startswith(b'SAID '):
            return line.decode()[len('SAID ') :].strip()
    raise AssertionError('it has ended without a word')


@pytest.fixture
def kept_in(tmp_path):
    """What runs a script under oracle_run, with all that a program keeps in files."""
    return [
        '-c',
        RUNNER,
        '--record',
        str(tmp_path / 'bags'),
        '--checkpoint',
        str(tmp_path / 'store'),
        '--rates-file',
        str(tmp_path / 'rates'),
    ]


@pytest.fixture
def script(tmp_path):
    """Write a script beside the one that starts processes, whose names it has."""

    def write(text):
        path = tmp_path / 'task.py'
        path.write_text(
            'import sys; sys.path.insert(0, {!r})\nfrom forking_script import *\n'.format(
                os.path.dirname(SCRIPT)
            )
            + textwrap.dedent(text)
        )
        return str(path)

    return write


def events_of(bag):
    with rosbag.Bag(str(bag)) as recorded:
        return [event for _, event, _ in recorded.read_messages('/oracle/events')]


@pytest.mark.parametrize('kind', sorted(forking_script.KINDS))
def test_children_start_and_end_as_without_an_oracle(kept_in, warm_python, kind, tmp_path):
    ended = warm_python.run([*kept_in, SCRIPT, kind], timeout=60, env=ENVIRONMENT)
    assert said(ended) == said(run(SCRIPT, kind)), ended.stderr
    for bag in (tmp_path / 'bags').iterdir():
        seqs = [event.seq for event in events_of(bag)]
        assert seqs == list(range(len(seqs)))  # none is missing, and none is there twice
    with sqlite3.connect(str(tmp_path / 'store')) as store:
        assert store.execute('PRAGMA integrity_check').fetchone() == ('ok',)
        assert not store.execute('SELECT * FROM trials WHERE ended IS NULL').fetchall()
    paths = json.loads((tmp_path / 'rates').read_text())['containers']
    assert paths['']


def test_a_child_that_outlives_its_program_holds_neither_its_bag_nor_its_store(
    script, kept_in, tmp_path
):
    path = script("""
        class Start(smach.State):
            def __init__(self):
                smach.State.__init__(self, outcomes=['succeeded'])
            def execute(self, userdata):
                child = multiprocessing.get_context('fork').Process(target=sleep)
                child.start()
                said(child.pid)
                os.kill(os.getpid(), signal.SIGKILL)
        top = smach.StateMachine(outcomes=['succeeded'])
        with top:
            smach.StateMachine.add('START', Start())
        top.execute()
        """)
    program = subprocess.Popen(
        [sys.executable, *kept_in, path],
        stdout=subprocess.PIPE,
        env=ENVIRONMENT,
    )
    child = json.loads(first_said(program))
    try:
        assert program.wait(30) == -signal.SIGKILL
        os.kill(child, 0)  # it lives
        for locked in [*(tmp_path / 'bags').iterdir(), *tmp_path.glob('store-lock-*')]:
            with open(str(locked), 'r+b') as file:
                # the child lets go as soon as it runs, which may be a little later
                assert wait_for(lambda: can_lock(file)), locked
    finally:
        os.kill(child, signal.SIGKILL)
        program.stdout.close()


def test_the_log_says_once_that_a_child_begins_its_machines_without_an_oracle(script):
    path = script("""
        def work():
            for _ in range(2):
                top = smach.StateMachine(outcomes=['succeeded'])
                with top:
                    smach.StateMachine.add('ONE', smach.CBState(
                        lambda userdata: 'succeeded', outcomes=['succeeded']))
                said(top.execute())
        child = multiprocessing.get_context('fork').Process(target=work)
        child.start()
        child.join()
        """)
    ended = run('-c', RUNNER, path)
    assert said(ended) == (['SAID succeeded'] * 2, 0)
    assert (ended.stdout + ended.stderr).count('without an oracle there') == 1


def can_lock(file):
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


ASYNCIO = """
import asyncio
heard = []
async def main():
    loop = asyncio.get_running_loop()
    stop = asyncio.Event()
    loop.add_signal_handler(signal.SIGUSR1, lambda: (heard.append('usr1'), stop.set()))
    os.kill(os.getpid(), signal.SIGUSR1)
    await asyncio.wait_for(stop.wait(), 10)
    loop.add_signal_handler(signal.SIGTERM, lambda: (heard.append('term'), done.set()))
    done = asyncio.Event()
    os.kill(os.getpid(), signal.SIGTERM)
    await asyncio.wait_for(done.wait(), 10)
    loop.remove_signal_handler(signal.SIGUSR1)
    loop.remove_signal_handler(signal.SIGTERM)
asyncio.run(main())
said(heard)
said(signal.getsignal(signal.SIGTERM))
said(signal.set_wakeup_fd(-1))
"""
# says what `begin` returns, and then heeds nothing
NEVER_ENDS = """
class Deaf(smach.State):
    def __init__(self):
        smach.State.__init__(self, outcomes=['succeeded'])
    def execute(self, userdata):
        has_begun = False
        while True:
            try:
                if not has_begun:
                    has_begun = True
                    said(begin())
                time.sleep(0.1)
            except BaseException:
                pass
top = smach.StateMachine(outcomes=['succeeded'])
with top:
    smach.StateMachine.add('DEAF', Deaf())
top.execute()
"""


def test_a_loop_of_asyncio_hears_its_signals(kept_in, script):
    path = script(ASYNCIO)
    assert (
        said(run(*kept_in, path))
        == said(run(path))
        == (["SAID ['usr1', 'term']", 'SAID {}'.format(signal.SIG_DFL), 'SAID -1'], 0)
    )


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_signals_are_heard_after_a_loop_of_asyncio(script, number, tmp_path):
    path = script(ASYNCIO + "begin = lambda: 'ready'" + NEVER_ENDS)
    program = subprocess.Popen(
        [sys.executable, '-c', RUNNER, '--record', str(tmp_path / 'bags'), path],
        stdout=subprocess.PIPE,
        env=ENVIRONMENT,
    )
    try:
        while first_said(program) != 'ready':
            pass
        program.send_signal(number)
        assert program.wait(30) == 128 + number
    finally:
        program.kill()
        program.stdout.close()
    (bag,) = (tmp_path / 'bags').iterdir()
    assert bag.suffix == '.bag', 'it is closed'


def test_a_program_that_is_ended_by_force_leaves_no_child(script):
    path = script(
        """
def begin():
    global workers
    workers = multiprocessing.get_context('fork').Pool(2)
    return [each.pid for each in workers._pool]
"""
        + NEVER_ENDS
    )
    program = subprocess.Popen(
        [sys.executable, '-c', RUNNER, path],
        stdout=subprocess.PIPE,
        env=ENVIRONMENT,
        start_new_session=True,
    )
    try:
        first = json.loads(first_said(program))
        assert set(first) < living(program.pid)
        program.send_signal(signal.SIGTERM)
        assert program.wait(30) == 128 + signal.SIGTERM
        # a Pool begins new workers in place of those that end: they are to be gone, too
        assert wait_for(lambda: not living(program.pid)), (first, living(program.pid))
    finally:
        program.stdout.close()
        for each in living(program.pid):
            os.kill(each, signal.SIGKILL)
        program.wait(30)


OWNERS = """
import os
import sys

from smach_oracle.forking import in_child


class Part:
    def _let_go(self):
        print('let go', flush=True)

    def _fail(self):
        raise ValueError('this one cannot')


kept, freed, odd = Part(), Part(), Part()
for decision in (odd._fail, kept._let_go, freed._let_go):
    in_child(decision)
kept.itself = kept  # freed as the process ends, after the module's names
del freed, decision
child = os.fork()
if child:
    os.waitpid(child, 0)
"""


def test_each_part_that_lives_lets_go_once_and_the_end_of_the_process_says_nothing():
    ended = subprocess.run(
        [sys.executable, '-c', OWNERS],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        universal_newlines=True,
    )
    assert (ended.stdout, ended.returncode) == ('let go\n', 0)
    assert 'this one cannot' in ended.stderr and ended.stderr.count('Traceback') == 1


def living(session):
    """The processes of a session that have not ended."""
    found = set()
    for stat in Path('/proc').glob('[0-9]*/stat'):
        try:
            state, _, _, its_session = stat.read_text().rsplit(')', 1)[1].split()[:4]
        except (FileNotFoundError, ProcessLookupError):
            continue
        if int(its_session) == session and state != 'Z':
            found.add(int(stat.parent.name))
    return found
