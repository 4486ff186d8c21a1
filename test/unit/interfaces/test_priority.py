"""What a node takes of a busy machine."""

import os
import subprocess
import sys

import pytest

from smach_oracle.interfaces import priority

# in a process of its own, since who has taken a low place cannot go back
SCRIPT = """
import os, threading
from smach_oracle.interfaces.priority import set_nice
held = threading.Event()
threading.Thread(target=held.wait, daemon=True).start()
done = set_nice(7)
nices = {os.getpriority(os.PRIO_PROCESS, int(each)) for each in os.listdir('/proc/self/task')}
session = open('/proc/self/autogroup').read() if os.path.exists('/proc/self/autogroup') else ''
print(done, sorted(nices), 'nice 7' in session or not session)
"""


def told(*command):
    # in a session of its own, so that the one of the tests keeps its place
    return subprocess.run(
        [*command, sys.executable, '-c', SCRIPT],
        check=True,
        stdout=subprocess.PIPE,
        universal_newlines=True,
        start_new_session=True,
    ).stdout


def test_all_threads_of_a_node_take_it_and_its_session_does():
    assert told() == 'True [7] True\n'


@pytest.mark.skipif(not os.path.exists('/proc/self/autogroup'), reason='time is not shared so here')
def test_a_session_that_is_others_too_is_left_alone():
    assert told('sh', '-c', '"$@"; true', 'sh') == 'True [7] False\n'


def test_a_system_that_does_not_allow_it_is_told_and_nothing_fails(monkeypatch):
    def refused(*_):
        raise PermissionError(1, 'not permitted')

    said = []
    monkeypatch.setattr(priority.os, 'setpriority', refused)
    monkeypatch.setattr(priority.rospy, 'get_param', lambda _key, default: default)
    monkeypatch.setattr(priority.rospy, 'loginfo', lambda text, *words: said.append(text % words))
    monkeypatch.setattr(priority.rospy, 'resolve_name', lambda key: key)
    priority.take_priority()
    assert ['nice -10 is not allowed here' in text for text in said] == [True]
