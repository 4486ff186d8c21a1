"""scripts/test --python: what it refuses, and which test files another Python leaves out."""

import os
import subprocess
import sys
import venv

import pytest
from house import ROOT

sys.path.insert(0, str(ROOT / 'test/harness'))

import interpreter


def test_what_is_no_interpreter_is_refused(tmp_path):
    with pytest.raises(interpreter.InterpreterError, match='python9: No such file'):
        interpreter.make_venv(tmp_path, tmp_path / 'python9')
    with pytest.raises(interpreter.InterpreterError, match='ended with 1'):
        interpreter.make_venv(tmp_path, '/bin/false')


def test_an_interpreter_that_is_too_old_is_refused(tmp_path):
    old = tmp_path / 'python3.6'
    old.write_text('#!/bin/sh\necho 3.6.15\n')
    old.chmod(0o755)
    with pytest.raises(interpreter.InterpreterError, match='is Python 3.6.15; allowed: 3.8'):
        interpreter.make_venv(tmp_path, old)


def test_the_venv_has_both_lists_and_the_systems_packages_behind_them(tmp_path, monkeypatch):
    said = []

    def run(command):
        said.append(command)
        if 'venv' in command:
            venv.create(command[-1])
            return ''
        return '3.8.18' if command[0] == 'python3.8' else str(tmp_path)

    monkeypatch.setattr(interpreter, '_run', run)
    for name in interpreter.LISTS:
        (tmp_path / name).write_text((ROOT / name).read_text())
    python = interpreter.make_venv(tmp_path, 'python3.8')
    assert python == tmp_path / '.venv-3.8.18/bin/python' and python.exists()
    installed = [command for command in said if 'pip' in command]
    assert len(installed) == 1 and installed[0][-3:] == [
        str(tmp_path / interpreter.LISTS[0]),
        '-r',
        str(tmp_path / interpreter.LISTS[1]),
    ]
    assert (tmp_path / 'zz_system.pth').read_text() == interpreter.SYSTEM_PACKAGES + '\n'
    interpreter.make_venv(tmp_path, 'python3.8')
    assert installed == [command for command in said if 'pip' in command], 'once is enough'


@pytest.mark.parametrize(
    'lacks, code, told',
    [('no_such_thing', 0, '1 passed, 1 skipped'), ('another', 2, 'No module named')],
)
def test_a_file_that_imports_what_cannot_be_had_is_left_out_and_nothing_else(
    tmp_path, lacks, code, told
):
    (tmp_path / 'conftest.py').write_text((ROOT / 'test/unit/conftest.py').read_text())
    (tmp_path / 'test_without.py').write_text('import no_such_thing.part\n')
    (tmp_path / 'test_with.py').write_text('def test_one():\n    pass\n')
    ran = subprocess.run(
        [sys.executable, '-m', 'pytest', '-q', str(tmp_path)],
        check=False,
        cwd=str(tmp_path),
        stdout=subprocess.PIPE,
        timeout=60,
        env=dict(os.environ, **{interpreter.MAY_LACK: lacks}),
    )
    assert ran.returncode == code and told in ran.stdout.decode()
