"""A store that cannot be used ends oracle_run with one line and exit code 2; no state runs."""

import ctypes
import os
import subprocess
import sys

import pytest
from machine_scripts import MACHINES, RUNNER

from smach_oracle.store.holding import MachineLock
from smach_oracle.store.store_file import StoreFile

SCRIPT = (
    'import smach\n'
    + MACHINES
    + """
print('SCRIPT RUNS', flush=True)
sm = machine('HOME', 'PICK')
sm['HOME'].execute = lambda userdata: print('MOVES', flush=True) or 'succeeded'
WORK
"""
)
EXECUTES = 'sm.execute()'
# the script takes every error for its own
CATCHES = 'try:\n    sm.execute()\nexcept Exception as err:\n    print("CAUGHT", err)'
IN_A_THREAD = """
import threading
threading.Thread(target=sm.execute).start()
threading.Event().wait(60)
"""
LIBC = ctypes.CDLL(None, use_errno=True)
PR_CAPBSET_DROP, CAP_DAC_OVERRIDE = 24, 1


def obey_modes():
    """In a child that is about to execute a program: the modes of files hold for root, too.

    Another user may not be able to read this checkout, which may lie below /root.
    """
    if os.geteuid() == 0 and LIBC.prctl(PR_CAPBSET_DROP, CAP_DAC_OVERRIDE, 0, 0, 0):
        raise OSError(ctypes.get_errno(), 'root cannot be made to obey the modes of files')


@pytest.fixture
def run(tmp_path, warm_python):
    """Run a script under oracle_run with a store; returns exit code, output and errors."""

    def run_script(store, text=EXECUTES, options=(), before=None):
        (tmp_path / 'task.py').write_text(SCRIPT.replace('WORK', text))
        command = ['-c', RUNNER, '--checkpoint', str(store), *options, 'task.py']
        how = {
            'cwd': str(tmp_path),
            'timeout': 60,
            'env': dict(os.environ, ROS_MASTER_URI='http://localhost:1'),
        }
        if before is None:
            done = warm_python.run(command, **how)
        else:
            done = subprocess.run(
                [sys.executable, *command],
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                universal_newlines=True,
                preexec_fn=before,
                **how,
            )
        return done.returncode, done.stdout, done.stderr

    return run_script


def check_refused(done, why):
    code, out, errors = done
    assert code == 2, errors
    assert 'MOVES' not in out and 'CAUGHT' not in out and 'Traceback' not in errors
    told = [line for line in errors.splitlines() if line.startswith('oracle_run: ')]
    assert len(told) == 1 and why in told[0], errors


def damaged(path):
    StoreFile(str(path)).close()
    whole = path.read_bytes()
    path.write_bytes(whole[:100] + b'\xa5' * (len(whole) - 100))


def test_a_folder_that_is_not_there_is_told_before_the_script_runs(run, tmp_path):
    done = run(tmp_path / 'none' / 'robot.db')
    check_refused(done, 'there is no folder')
    assert 'SCRIPT RUNS' not in done[1]


@pytest.mark.parametrize('text', [EXECUTES, CATCHES, IN_A_THREAD])
def test_what_is_no_database_is_told(run, tmp_path, text):
    (tmp_path / 'notes.txt').write_text('These are my notes, and no store of a machine. ' * 20)
    check_refused(run(tmp_path / 'notes.txt', text), 'notes.txt: is damaged, or no store')
    assert (tmp_path / 'notes.txt').read_text().startswith('These are my notes')


def test_a_damaged_store_is_told(run, tmp_path):
    damaged(tmp_path / 'robot.db')
    check_refused(run(tmp_path / 'robot.db'), 'robot.db: is damaged, or no store')


def test_a_store_that_another_process_holds_is_told_with_its_number(run, tmp_path):
    lock = MachineLock(str(tmp_path / 'robot.db'), 'TASK')
    lock.take()
    check_refused(run(tmp_path / 'robot.db'), 'is held by process {}'.format(os.getpid()))
    lock.release()
    assert run(tmp_path / 'robot.db')[0] == 0


def test_a_store_that_cannot_be_written_is_told(run, tmp_path):
    store = tmp_path / 'robot.db'
    StoreFile(str(store)).close()
    assert run(store, before=obey_modes)[0] == 0
    store.chmod(0o444)
    check_refused(run(store, before=obey_modes), 'not for this user to write')


def test_a_state_to_go_on_with_that_is_not_there_is_told(run, tmp_path):
    run(
        tmp_path / 'robot.db',
        "import os\nsm['HOME'].execute = lambda userdata: os._exit(9)\nsm.execute()",
    )
    check_refused(
        run(tmp_path / 'robot.db', options=['--resume=state:NOWHERE']), "on_resume: 'state:NOWHERE'"
    )
    check_refused(run(tmp_path / 'robot.db', options=['--from', '999']), 'checkpoint.from: 999')


def test_a_map_is_given_on_the_command_line(run, tmp_path):
    store = tmp_path / 'robot.db'
    run(store, "import os\nsm['HOME'].execute = lambda userdata: os._exit(9)\nsm.execute()")
    changed = "sm = machine('START', 'PICK')\nprint('OUTCOME', sm.execute())"
    check_refused(
        run(store, changed, ['--resume', '--resume-map', 'HOEM=START']),
        "checkpoint.map.HOEM: 'HOEM' is not allowed; allowed: a state of the machine that "
        'was stopped: HOME, PICK',
    )
    code, _, errors = run(store, changed, ['--resume', '--resume-map', 'HOME'])
    assert code == 2 and 'OLD=NEW is wanted' in errors
    code, out, errors = run(store, changed, ['--resume', '--resume-map', 'HOME=START'])
    assert code == 0 and 'OUTCOME succeeded' in out, errors
    assert 'goes on with HOME as START' in out + errors
