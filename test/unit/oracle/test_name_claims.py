"""The claims on names in a rates file: each lives exactly as long as its owners."""

import contextlib
import gc
import os
import subprocess
import sys

from smach_oracle.oracle.records import folder_locks
from smach_oracle.oracle.records.folder_locks import claim, is_claimed


class Owner:
    pass


@contextlib.contextmanager
def child_that_waits(does=lambda: None):
    """Fork a child that does something, and lives until the body has ended."""
    ready, go = os.pipe(), os.pipe()
    pid = os.fork()
    if not pid:
        try:
            does()
            os.write(ready[1], b'.')
            os.close(go[1])
            os.read(go[0], 1)
        finally:
            os._exit(0)
    try:
        os.close(ready[1])
        assert os.read(ready[0], 1) == b'.'
        yield
    finally:
        os.close(go[1])
        os.waitpid(pid, 0)
        os.close(ready[0])
        os.close(go[0])


def lines_of_a_claim(at_line):
    """Trace what runs in folder_locks, and call `at_line` with the number of each line."""
    count = 0

    def trace(frame, event, arg):
        nonlocal count
        if frame.f_code.co_filename != folder_locks.__file__:
            return None
        if event == 'line':
            count += 1
            at_line(count)
        return trace

    return trace


def claimed_while_another_goes(path, line):
    """Claim a name, while its owner of before goes at a line. Return whether it has gone."""
    owners = [Owner()]
    claim(path, 'TASK', owners[0])
    new, other = Owner(), Owner()
    before = sys.gettrace()
    sys.settrace(lines_of_a_claim(lambda now: owners.clear() if now == line else None))
    try:
        claim(path, 'TASK', new)
    finally:
        sys.settrace(before)
    assert is_claimed(path, 'TASK', False)
    claim(path, 'TASK', other)
    del other
    assert is_claimed(path, 'TASK', False), 'NEW lives, and the other went at line {}'.format(line)
    del new
    assert is_claimed(path, 'TASK', True) == bool(owners)
    return not owners


def test_an_owner_that_goes_while_another_claims_takes_no_claim_with_it(tmp_path):
    path, line = str(tmp_path / 'rates.json'), 1
    while claimed_while_another_goes(path, line):
        line += 1
    assert line > 3


def test_a_name_is_claimed_once_its_folder_is_there(tmp_path):
    path, owner = str(tmp_path / 'later' / 'rates.json'), Owner()
    claim(path, 'TASK', owner)
    assert not is_claimed(path, 'TASK', False)
    os.mkdir(os.path.dirname(path))
    claim(path, 'TASK', owner)
    assert is_claimed(path, 'TASK', False)
    del owner
    assert not is_claimed(path, 'TASK', True)


def test_a_folder_that_was_made_anew_is_claimed_in_place_of_the_old_one(tmp_path):
    folder, moved = tmp_path / 'folder', tmp_path / 'moved'
    folder.mkdir()
    path, owner = str(folder / 'rates.json'), Owner()
    claim(path, 'TASK', owner)
    folder.rename(moved)
    claim(path, 'TASK', owner)
    folder.mkdir()
    claim(path, 'TASK', owner)
    assert is_claimed(path, 'TASK', False)
    assert not is_claimed(str(moved / 'rates.json'), 'TASK', True)


def test_a_child_keeps_no_claim_on_a_folder_that_was_replaced(tmp_path):
    folder, moved = tmp_path / 'folder', tmp_path / 'moved'
    folder.mkdir()
    path, one, two = str(folder / 'rates.json'), Owner(), Owner()
    for owner in (one, two):
        claim(path, 'TASK', owner)
    folder.rename(moved)
    folder.mkdir()
    claim(path, 'TASK', two)
    with child_that_waits():
        assert is_claimed(str(moved / 'rates.json'), 'TASK', False)
        del owner, one, two
        assert not is_claimed(str(moved / 'rates.json'), 'TASK', True)
        assert not is_claimed(path, 'TASK', True)


def test_claims_leave_no_file_open_once_their_owners_are_gone(tmp_path):
    def descriptors():
        return len(os.listdir('/proc/self/fd'))

    gc.collect()  # machines of other tests
    path, before = str(tmp_path / 'rates.json'), descriptors()
    owners = [Owner() for _ in range(50)]
    for owner in owners * 2:
        claim(path, 'TASK', owner)
    assert descriptors() == before + 1, 'owners of one name share it'
    del owner
    owners.clear()
    assert descriptors() == before


def test_a_child_claims_for_itself_and_leaves_the_claim_of_its_parent(tmp_path):
    path, owners = str(tmp_path / 'rates.json'), [Owner()]
    claim(path, 'TASK', owners[0])

    def claims_again():
        claim(path, 'TASK', owners[0])
        claim(path, 'CHILD', owners[0])

    with child_that_waits(claims_again):
        owners.clear()
        assert is_claimed(path, 'TASK', False) and is_claimed(path, 'CHILD', False)
    assert not is_claimed(path, 'TASK', True) and not is_claimed(path, 'CHILD', True)


def test_a_child_that_claims_nothing_keeps_no_claim(tmp_path):
    path, owner = str(tmp_path / 'rates.json'), Owner()
    claim(path, 'TASK', owner)
    with child_that_waits():
        assert is_claimed(path, 'TASK', False)
        del owner
        assert not is_claimed(path, 'TASK', True), 'the child lives'


PROGRAM = """
import os, sys
sys.path[:0] = {path!r}
from smach_oracle.oracle.records.folder_locks import claim
class Owner: pass
owner = Owner()
claim(sys.argv[1], 'TASK', owner)
os.closerange(3, 100)
"""


def test_a_program_that_closes_all_files_as_a_daemon_does_ends_without_a_word(tmp_path):
    program = [sys.executable, '-c', PROGRAM.format(path=sys.path), str(tmp_path / 'rates.json')]
    ended = subprocess.run(program, stderr=subprocess.PIPE, check=True, timeout=60)
    assert b'Error' not in ended.stderr
