"""Answers to a goal that come before actionlib's client has noted which goal it is."""

import threading

import pytest
from actionlib import CommState, SimpleActionClient

from smach_oracle.ros.goal_tracking import track_goals_from_the_start


class Handle:
    """A goal that has succeeded."""

    def get_comm_state(self):
        return CommState.DONE

    def get_goal_status(self):
        return 3

    def get_result(self):
        return 'result'


class FastServer:
    """Its answer is there before the goal is sent."""

    ns = 'move'

    def __init__(self):
        self.answering = None

    def send_goal(self, goal, transition, feedback):
        handle = Handle()
        self.answering = threading.Thread(target=transition, args=(handle,), daemon=True)
        self.answering.start()
        # lost by now, or waiting for the client
        self.answering.join(0.3)
        return handle


class Client(SimpleActionClient):
    """Without ROS."""

    def __init__(self):
        self.gh = None
        self.done_condition = threading.Condition()
        self.action_client = FastServer()


@pytest.fixture
def client(monkeypatch):
    """A client; afterwards actionlib is as it was."""
    for name in ('send_goal', '_handle_transition'):
        monkeypatch.setattr(SimpleActionClient, name, getattr(SimpleActionClient, name))
    return Client()


def test_an_answer_that_comes_at_once_is_not_lost(client):
    track_goals_from_the_start()
    track_goals_from_the_start()
    done = []
    client.send_goal('goal', lambda *result: done.append(result))
    client.action_client.answering.join(20.0)
    assert done == [(3, 'result')]


def test_who_waits_for_the_end_with_a_lock_of_his_own_gets_it(client):
    """As upstream's SimpleActionState does."""
    track_goals_from_the_start()
    condition, done = threading.Condition(), []

    def end(*result):
        with condition:
            done.append(result)
            condition.notify()

    with condition:
        client.send_goal('goal', end)
        assert condition.wait_for(lambda: done, 20.0)


def test_who_is_told_of_the_end_may_send_the_next_goal(client):
    track_goals_from_the_start()
    sent = threading.Event()

    def again(*result):
        client.send_goal('next')
        sent.set()

    client.send_goal('goal', again)
    assert sent.wait(20.0)
