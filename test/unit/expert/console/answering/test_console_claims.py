"""Claims of people whose pages are there are renewed, whichever robot hangs; of closed questions
they are forgotten.
"""

import threading

import pytest
import rospy
from expert_fixtures import make_question

from smach_oracle.expert.claims import MOST_MISSED, ClaimKeeper
from smach_oracle.expert.console.answering.question_commands import QuestionCommands
from smach_oracle.expert.console.commands.commands import PageCommand
from smach_oracle.expert.console.web.audit import Person
from smach_oracle.expert.followed_server import ListedQuestion
from smach_oracle.msg import OpenQuery
from smach_oracle.ros.expert.question_messages import to_goal
from smach_oracle.srv import ClaimQueryRequest, ClaimQueryResponse

ANN = Person('10.0.0.7', 'abc', 'operator', 'ann')


class Server:
    """Of one robot; a renewal waits for `answers`."""

    def __init__(self):
        self.actions = []
        self.answers = threading.Event()
        self.answers.set()

    def claim(self, query_id, expert, action, lease_s):
        self.actions.append(action)
        self.answers.wait(20.0)
        return ClaimQueryResponse(ok=True, message='')


class Front:
    """Open questions and the robots that put them."""

    def __init__(self, robots):
        self.servers = {robot: Server() for robot in robots}
        self.open = {
            robot: ListedQuestion(
                robot,
                to_goal(make_question('q'), robot, asked=rospy.Time(1)),
                OpenQuery.PENDING,
                '',
                0.0,
                1e9,
            )
            for robot in robots
        }

    def find(self, key):
        return next((listed for listed in self.open.values() if listed.key == key), None)

    def server(self, listed):
        return self.servers[listed.server]


class Silent:
    def record(self, *_):
        """Nobody listens."""


@pytest.fixture(name='commands')
def make_commands(monkeypatch):
    """A desk where page 1 has claimed a question of each of three robots; it renews when it is
    told.
    """
    monkeypatch.setattr(ClaimKeeper, '_run', lambda self: None)
    front = Front(['/a', '/b', '/c'])
    made = QuestionCommands(front, Silent(), {})
    for listed in front.open.values():
        assert made.carry_out(PageCommand(1, 'claim', {'question': listed.key}), ANN, 1).ok
    return made, front


def renewals(front, robot):
    return front.servers[robot].actions.count(ClaimQueryRequest.RENEW)


def test_robots_that_hang_cost_no_claim_of_the_others(commands):
    made, front = commands
    renewed = threading.Event()
    for robot in ('/a', '/b'):
        front.servers[robot].answers.clear()
    claim = front.servers['/c'].claim
    front.servers['/c'].claim = lambda *given: (claim(*given), renewed.set())[0]
    thread = threading.Thread(target=made.claims.renew)
    thread.start()
    assert renewed.wait(10.0), 'while the others hang'
    for server in front.servers.values():
        server.answers.set()
    thread.join(20.0)
    assert [renewals(front, robot) for robot in ('/a', '/b', '/c')] == [1, 1, 1]


def test_a_question_that_is_closed_is_forgotten_and_one_whose_server_is_restarted_is_not(commands):
    made, front = commands
    closed, restarted = front.open.pop('/a'), front.open.pop('/b')
    made.claims.renew()
    front.open['/b'] = restarted
    for _ in range(MOST_MISSED + 1):
        made.claims.renew()
    assert [renewals(front, robot) for robot in ('/a', '/b', '/c')] == [
        0,
        MOST_MISSED + 1,
        MOST_MISSED + 2,
    ]
    assert (closed.key, 'ann') not in made.claims.held and len(made.claims.held) == 2


def test_a_page_that_is_gone_renews_nothing(commands):
    made, front = commands
    made.leave(1)
    made.claims.renew()
    assert [renewals(front, robot) for robot in ('/a', '/b', '/c')] == [0, 0, 0]
