"""The example of a pytest, as a newcomer runs it; test/rostest/testing_bench.test has the other."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
PICKS_WRONGLY = """def test_wrong():
    settings = {'max_recoveries': 0}
    with Bench(build_machine(), [fail('PICK')], settings=settings) as bench:
        bench.run().assert_recovered('PICK')
"""


def run_pytest(*arguments):
    path = [os.environ.get('SMACH_UPSTREAM'), os.environ.get('PYTHONPATH'), str(ROOT / 'src')]
    env = dict(os.environ, PYTHONPATH=os.pathsep.join(filter(None, path)))
    done = subprocess.run(
        [
            sys.executable,
            '-m',
            'pytest',
            '-p',
            'no:cacheprovider',
            '--rootdir',
            str(ROOT / 'examples'),
        ]
        + [str(each) for each in arguments],
        env=env,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        timeout=120,
        check=False,
    )
    return done.returncode, done.stdout.decode()


def test_the_example_passes():
    code, said = run_pytest('-q', ROOT / 'examples')
    assert code == 0 and '6 passed' in said, said


def test_a_failed_assertion_shows_the_course_and_the_line_of_the_test(tmp_path):
    for name in ('fetch_task.py', 'test_fetch_task.py'):
        (tmp_path / name).write_text((ROOT / 'examples' / name).read_text())
    with (tmp_path / 'test_fetch_task.py').open('a') as file:
        file.write('\n\n' + PICKS_WRONGLY)
    code, said = run_pytest('-q', '--no-header', tmp_path, '-k', 'test_wrong')
    assert code == 1
    shown = said.split('Captured')[0]
    assert "the trial was to recover from the failure of PICK, and it ended in 'aborted'" in shown
    assert 'PICK    fault: ends in' in shown
    assert (
        'test_fetch_task.py:{}: AssertionError'.format(
            len((tmp_path / 'test_fetch_task.py').read_text().splitlines())
        )
        in shown
    )
    assert 'observed_trial.py' not in shown


@pytest.mark.parametrize(
    'name', ['fetch_task.py', 'test_fetch_task.py', 'fetch_task_rostest.py', 'fetch_task.test']
)
def test_the_page_names_the_files_to_copy(name):
    assert '(../examples/{})'.format(name) in (ROOT / 'doc/testing.md').read_text(encoding='utf-8')
