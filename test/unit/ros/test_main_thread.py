"""Calls to the master run outside the main thread."""

import threading

import pytest
import rospy

from smach_oracle.ros.main_thread import outside_main_thread


@pytest.fixture
def _in_a_node(monkeypatch):
    monkeypatch.setattr(rospy.core, 'is_initialized', lambda: True)


@pytest.mark.usefixtures('_in_a_node')
def test_a_call_from_the_main_thread_runs_in_another_one_and_returns():
    assert outside_main_thread(threading.current_thread) is not threading.main_thread()


def test_without_a_node_a_call_stays_in_its_thread():
    assert outside_main_thread(threading.current_thread) is threading.main_thread()


@pytest.mark.usefixtures('_in_a_node')
def test_a_call_from_another_thread_stays_in_it():
    found = []
    thread = threading.Thread(
        target=lambda: found.append(outside_main_thread(threading.current_thread))
    )
    thread.start()
    thread.join()
    assert found == [thread]


@pytest.mark.usefixtures('_in_a_node')
def test_what_it_raises_is_raised_here():
    def fails():
        raise OSError('no such folder')

    with pytest.raises(OSError, match='no such folder'):
        outside_main_thread(fails)


@pytest.mark.usefixtures('_in_a_node')
def test_a_call_that_does_not_come_back_is_left_behind_at_a_shutdown(monkeypatch):
    monkeypatch.setattr(rospy.core, 'is_shutdown_requested', lambda: True)
    monkeypatch.setattr('smach_oracle.ros.main_thread.SHUTDOWN_WAIT_S', 0.2)
    hangs = threading.Event()
    with pytest.raises(rospy.ROSInterruptException, match='has not answered'):
        outside_main_thread(hangs.wait)
    hangs.set()
