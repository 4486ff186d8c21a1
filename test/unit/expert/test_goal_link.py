"""What of a goal on its way counts as lost; no master."""
import time

import pytest
from actionlib import CommState

from smach_oracle.ros.goal_link import SentGoal, _reaches


class FakeHandle:
    def __init__(self, state):
        self._state = state

    def get_comm_state(self):
        return self._state

    def get_terminal_state(self):
        return 3

    def get_result(self):
        return 'the result'

    def get_goal_status_text(self):
        return 'as told'


def sent_and_seen(*states):
    sent = SentGoal(time.monotonic())
    for state in states:
        sent.on_transition(FakeHandle(state))
    return sent


@pytest.mark.parametrize('states, lost', [
    ([], True), ([CommState.PENDING], False), ([CommState.PENDING, CommState.ACTIVE], False),
    ([CommState.ACTIVE, CommState.WAITING_FOR_RESULT], True)])
def test_a_goal_nobody_took_up_and_an_end_without_a_result_are_lost_in_time(states, lost):
    sent = sent_and_seen(*states)
    assert not sent.unheard(time.monotonic() + 1.0)
    assert sent.unheard(time.monotonic() + 60.0) == lost


def test_a_result_that_is_here_is_an_event():
    event = sent_and_seen(CommState.ACTIVE, CommState.WAITING_FOR_RESULT, CommState.DONE).poll(0.0)
    assert (event.status, event.result, event.text) == (3, 'the result', 'as told')


class FakePublisher:
    """As rospy's: the connection of a node that has died is there until somebody checks."""

    def __init__(self, *nodes, dead=()):
        self.impl = self
        self._nodes = set(nodes)
        self._dead = set(dead)

    def check(self):
        self._nodes -= self._dead

    def has_connection(self, node):
        return node in self._nodes


def test_a_connection_to_a_node_that_has_died_reaches_nobody():
    assert _reaches(FakePublisher('/by_hand'), '/by_hand')
    assert not _reaches(FakePublisher('/by_hand', dead=['/by_hand']), '/by_hand')
    assert not _reaches(FakePublisher('/other'), '/by_hand')
