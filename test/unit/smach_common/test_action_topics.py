"""An action's topics as its client sees them; no master."""

import threading
import time

import pytest

pytest.importorskip('rospy')
from actionlib.msg import TestAction as Action

from smach_common import action_topics
from smach_common.action_topics import ActionTopics


class CountingClient:
    """Makes goal ids as actionlib does, without a lock: it reads the count, and writes it later."""

    count = 0

    def send_goal(self, goal, on_transition, on_feedback):
        number = CountingClient.count
        time.sleep(0.001)  # where another thread would read the same count
        CountingClient.count = number + 1
        return number


def test_goals_of_all_clients_of_a_process_get_ids_of_their_own(monkeypatch):
    monkeypatch.setattr(action_topics, '_open_undelayed', lambda name, action: [])
    clients = [
        ActionTopics(name, Action, lambda *_: CountingClient()) for name in ('/arm', '/base')
    ]
    ids = []

    def send(client):
        for _ in range(20):
            ids.append(client.send_goal('goal', None, None))

    threads = [threading.Thread(target=send, args=(client,)) for client in clients * 2]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(ids) == list(range(80))
