"""Interfaces that are started, and shared by the questions that use them: real processes, no
master.
"""

import sys
import threading

import pytest
import rospy
from waiting import wait_for

from smach_oracle.msg import InterfaceOutput
from smach_oracle.oracle.errors import InterfaceError
from smach_oracle.oracle.settings.interfaces import InterfaceOffer, InterfaceStart
from smach_oracle.ros.interfaces import starting
from smach_oracle.ros.interfaces.starting import InterfaceStarter

HELPER = InterfaceOffer('helper', '/helper', start=InterfaceStart('node', 'my_robot', 'helper'))
IDLE = "import time; print('up', flush=True); time.sleep(600)"


@pytest.fixture(name='told')
def what_is_published(monkeypatch):
    """All messages, in order."""
    told = []

    class Topic:
        def __init__(self, *_, **__):
            """No master."""

        def publish(self, message):
            told.append(message)

    monkeypatch.setattr(rospy, 'Publisher', Topic)
    monkeypatch.setattr(rospy, 'is_shutdown', lambda: False)
    monkeypatch.setattr(starting, 'command_of', lambda start: [sys.executable, '-c', IDLE])
    return told


@pytest.fixture(name='starter')
def make_starter(told):
    starter = InterfaceStarter()
    yield starter
    starter.stop()
    assert all(started.ended(20.0) for started in starter._last.values())


def statuses(told, query_id):
    """Each status of a question, without repetitions."""
    found = [message.status for message in list(told) if message.query_id == query_id]
    return [status for at, status in enumerate(found) if found[at - 1 : at] != [status]]


def test_a_second_question_shares_what_runs_and_the_last_one_that_leaves_ends_it(starter, told):
    left = starter.start(HELPER, 'left')
    left.publish_status(InterfaceOutput.RUNNING, 'it is there')
    right = starter.start(HELPER, 'right')
    assert right is left
    assert wait_for(lambda: any(each.query_id == 'right' and each.lines for each in told))
    left.leave('left')
    assert not right.ended(1.0) and starter.runs('helper')
    assert 'for another question' in [each.text for each in told if each.query_id == 'left'][-1]
    right.leave('right')
    assert right.ended(20.0) and not starter.runs('helper')
    started = [InterfaceOutput.STARTING, InterfaceOutput.RUNNING, InterfaceOutput.STOPPED]
    assert statuses(told, 'left') == started
    assert statuses(told, 'right') == started[1:]


def test_one_that_a_question_waits_for_in_vain_stays_for_the_other(starter, told):
    started = starter.start(HELPER, 'left')
    starter.start(HELPER, 'right').leave('right', 'taken back')
    assert not started.ended(0.5)
    assert statuses(told, 'right')[-1] == InterfaceOutput.FAILED
    started.leave('left')


def test_questions_at_the_same_moment_start_one_process(starter):
    together, found = threading.Barrier(4), []

    def ask(query_id):
        together.wait(10.0)
        found.append(starter.start(HELPER, query_id))

    threads = [threading.Thread(target=ask, args=(str(number),)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(20.0)
    assert len(found) == 4 and len(set(map(id, found))) == 1


def test_one_that_is_being_stopped_is_shared_no_longer(starter):
    first = starter.start(HELPER, 'first')
    first.leave('first')
    second = starter.start(HELPER, 'second')
    assert second is not first and first.ended(0.0) and not second.ended(0.1)


def test_one_that_is_used_is_not_stopped_for_another_start_of_its_name(starter, monkeypatch):
    used = starter.start(HELPER, 'used')
    monkeypatch.setattr(starting, 'END_LIMIT_S', 0.5)
    with pytest.raises(InterfaceError, match='has not ended within'):
        starter.start(HELPER._replace(start=InterfaceStart('node', 'my_robot', 'other')), 'q')
    assert not used.ended(0.1)
