"""Goals that are sent and cancelled from callbacks and threads, with actionlib's own locks.

actionlib calls transitions back under a lock of their goal: whoever then waits for a client must
not be waited for. No master.
"""

import threading

import actionlib.msg as messages
import pytest
import rospy
from actionlib import SimpleActionClient
from actionlib.action_client import GoalManager
from actionlib_msgs.msg import GoalStatus, GoalStatusArray

from smach_oracle.ros.goal_tracking import track_goals_from_the_start

LIMIT_S = 30.0
ROUNDS = 25


class Server:
    """Answers each goal in threads of its own, before or after `send_goal` has returned."""

    def __init__(self, manager):
        self.manager = manager
        self.threads = []

    def take(self, goal):
        for answer in (self.tell_status, self.tell_feedback, self.tell_result):
            self.start(answer, goal.goal_id)

    def start(self, function, *args):
        thread = threading.Thread(target=function, args=args, daemon=True)
        thread.start()
        self.threads.append(thread)

    def tell_status(self, goal_id):
        status = GoalStatus(goal_id, GoalStatus.ACTIVE, '')
        self.manager.update_statuses(GoalStatusArray(status_list=[status]))

    def tell_feedback(self, goal_id):
        status = GoalStatus(goal_id, GoalStatus.ACTIVE, '')
        self.manager.update_feedbacks(messages.TestActionFeedback(status=status))

    def tell_result(self, goal_id):
        status = GoalStatus(goal_id, GoalStatus.SUCCEEDED, '')
        self.manager.update_results(messages.TestActionResult(status=status))


class Link:
    """actionlib's ActionClient, without its topics."""

    ns = 'move'

    def __init__(self):
        self.manager = GoalManager(messages.TestAction)
        self.server = Server(self.manager)
        self.manager.register_send_goal_fn(self.server.take)
        self.manager.register_cancel_fn(lambda goal_id: None)
        self.send_goal = self.manager.init_goal


class Client(SimpleActionClient):
    """Without a master: the goals go to a server next to it."""

    def __init__(self):
        self.action_client = Link()
        self.server = self.action_client.server
        self.simple_state, self.gh = 0, None
        self.done_condition = threading.Condition()

    def send(self, **callbacks):
        """Send a goal in a thread of its own."""
        self.server.start(lambda: self.send_goal(messages.TestGoal(), **callbacks))


def assert_nobody_hangs(*clients):
    """Whom a thread starts is in a list before that thread ends."""
    for client in clients:
        for thread in client.server.threads:
            thread.join(LIMIT_S)
            assert not thread.is_alive()


@pytest.fixture(autouse=True)
def tracking(monkeypatch):
    """The client as it is under an oracle; afterwards actionlib is as it was."""
    for name in ('send_goal', '_handle_transition'):
        monkeypatch.setattr(SimpleActionClient, name, getattr(SimpleActionClient, name))
    monkeypatch.setattr(rospy, 'logerr', lambda *words: None)  # of goals that others replace
    monkeypatch.setattr(rospy, 'resolve_name', lambda name: '/' + name)
    monkeypatch.setattr(rospy, 'get_rostime', lambda: rospy.Time(1))
    monkeypatch.setattr(rospy.Time, 'now', lambda: rospy.Time(1))
    track_goals_from_the_start()


@pytest.mark.parametrize('called', ['done_cb', 'active_cb'])
def test_a_callback_sends_the_next_goal(called):
    for _ in range(ROUNDS):
        client, sent = Client(), threading.Event()

        def again(*_, client=client, sent=sent):
            client.send_goal(messages.TestGoal())
            sent.set()

        client.send(**{called: again})
        assert sent.wait(LIMIT_S)
        assert_nobody_hangs(client)


def test_feedback_sends_the_next_goal(monkeypatch):
    monkeypatch.setattr(Server, 'tell_result', lambda *_: None)  # none is told of an ended goal
    for _ in range(ROUNDS):
        client, sent = Client(), threading.Event()

        def again(*_, client=client, sent=sent):
            client.send_goal(messages.TestGoal())
            sent.set()

        client.send_goal(messages.TestGoal(), feedback_cb=again)
        # actionlib drops what comes before the goal is noted
        for status in client.server.manager._get_live_statuses():
            client.server.start(client.server.tell_feedback, status.action_goal.goal_id)
        assert sent.wait(LIMIT_S)
        assert_nobody_hangs(client)


def test_callbacks_of_two_clients_send_with_the_other_one():
    for _ in range(ROUNDS):
        first, second = Client(), Client()
        both = threading.Barrier(2)

        def meet_and_send(client, both=both):
            try:
                both.wait(0.2)  # where the other goal was not replaced
            except threading.BrokenBarrierError:
                pass
            client.send_goal(messages.TestGoal())

        first.send(done_cb=lambda *_, other=second, send=meet_and_send: send(other))
        second.send(done_cb=lambda *_, other=first, send=meet_and_send: send(other))
        assert_nobody_hangs(first, second, first)


def test_goals_are_cancelled_while_others_are_sent():
    client = Client()

    def send():
        for _ in range(ROUNDS):
            client.send_goal(messages.TestGoal(), lambda *_: client.cancel_goal())

    def cancel():
        for _ in range(10 * ROUNDS):
            client.cancel_goal()

    for function in (send, cancel, send, cancel):
        client.server.start(function)
    assert_nobody_hangs(client)
    assert len(client.server.threads) == 4 + 3 * 2 * ROUNDS
