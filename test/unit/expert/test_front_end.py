"""Servers come and go: a front end that finds them forgets those that are gone for good; no
master.
"""

from pathlib import Path
from types import SimpleNamespace

import pytest

from smach_oracle.expert import followed_server
from smach_oracle.expert import front_end as module
from smach_oracle.expert.claims import MOST_MISSED, ClaimKeeper
from smach_oracle.expert.followed_server import ListedQuestion
from smach_oracle.expert.front_end import FrontEnd, wait_for_question
from smach_oracle.msg import OpenQueries, OpenQuery
from smach_oracle.ros.service_calls import ServerGoneError
from smach_oracle.srv import ClaimQueryRequest

LIST = ['/robot/expert_query/open', OpenQueries._type]


class FakeServer:
    """A server that is followed; the last one is kept."""

    made = None

    def __init__(self, name, _on_change):
        FakeServer.made = self
        self.name = name
        self.connected = True
        self.stopped = False
        self.listed = []
        self.claims = []  # the actions of all calls

    def refresh(self, advertised, servers):
        """Nothing to be done."""

    def stop(self):
        self.stopped = True

    def questions(self):
        return self.listed

    def claim(self, _query_id, _expert, action, _lease_s=0.0):
        self.claims.append(action)
        return SimpleNamespace(ok=True)


@pytest.fixture(name='clock')
def make_clock(monkeypatch):
    """A clock to be set; nothing looks by itself."""

    class Clock:
        now_s = 0.0

    monkeypatch.setattr(module, 'FollowedServer', FakeServer)
    monkeypatch.setattr(module.time, 'monotonic', lambda: Clock.now_s)
    monkeypatch.setattr(FrontEnd, '_keep_connected', lambda self: None)
    monkeypatch.setattr(ClaimKeeper, '_run', lambda self: None)
    monkeypatch.setattr(module.rospy, 'resolve_name', lambda name: name)
    return Clock


def look_after(front_end, clock, seconds, *published):
    clock.now_s += seconds
    front_end._look_for_servers(published)


def test_a_server_that_is_gone_for_good_is_forgotten_and_found_again(clock):
    front_end = FrontEnd('ann')
    look_after(front_end, clock, 0.0, LIST)
    server = FakeServer.made
    server.connected = False
    look_after(front_end, clock, 1.0)
    look_after(front_end, clock, module._FORGET_S - 10.0)
    assert front_end.servers == ['/robot/expert_query'], 'it may be restarted'
    look_after(front_end, clock, 20.0)
    assert front_end.servers == [] and server.stopped
    with pytest.raises(ServerGoneError, match='/robot/expert_query is gone'):
        front_end.server(ListedQuestion('/robot/expert_query', None, 0, '', 0.0, 0.0))
    look_after(front_end, clock, 1.0, LIST)
    assert front_end.servers == ['/robot/expert_query']


def test_one_that_was_away_for_a_while_begins_anew(clock):
    front_end = FrontEnd('ann')
    look_after(front_end, clock, 0.0, LIST)
    FakeServer.made.connected = False
    for seconds, published in (
        (1.0, []),
        (module._FORGET_S - 10.0, [LIST]),
        (20.0, []),
        (20.0, []),
    ):
        look_after(front_end, clock, seconds, *published)
    assert front_end.servers == ['/robot/expert_query']


def test_one_that_was_named_is_followed_for_ever(clock):
    front_end = FrontEnd('ann', ['/robot/expert_query'])
    FakeServer.made.connected = False
    for _ in range(3):
        look_after(front_end, clock, 2 * module._FORGET_S)
    assert front_end.servers == ['/robot/expert_query']


def listed(key, status, holder=''):
    goal = SimpleNamespace(
        query_id=key, failed_state='PICK', choices=[SimpleNamespace(state='DETECT')]
    )
    return ListedQuestion('/robot/expert_query', goal, status, holder, 0.0, float('inf'))


OTHERS = [listed('held', OpenQuery.CLAIMED, 'bob'), listed('by hand', OpenQuery.INTERFACE_RUNNING)]


@pytest.mark.parametrize('missed, renewed', [(MOST_MISSED, True), (MOST_MISSED + 1, False)])
def test_a_claim_is_dropped_after_renewals_in_which_its_question_is_not_listed(
    clock, missed, renewed
):
    front_end = FrontEnd('ann', ['/robot/expert_query'])
    server, question = FakeServer.made, listed('ours', OpenQuery.PENDING)
    assert front_end.claim(question).ok
    for _ in range(missed):
        front_end._claims.renew()
    assert server.claims == [ClaimQueryRequest.CLAIM]
    server.listed = [question]  # it was a server that was being restarted
    front_end._claims.renew()
    front_end.stop()
    again = [ClaimQueryRequest.RENEW, ClaimQueryRequest.RELEASE] if renewed else []
    assert server.claims == [ClaimQueryRequest.CLAIM] + again


class Asking:
    """A front end with questions that others work on, and some that nobody does."""

    def __init__(self, *free, fails=0):
        self.free = list(free)
        self.claimed, self.answers, self.released = [], [], []
        self._fails = fails

    def questions(self):
        return OTHERS + [listed(key, OpenQuery.PENDING) for key in self.free]

    def wait_for_change(self, version, _timeout_s):
        return version

    def claim(self, question):
        if self._fails:
            self._fails -= 1
            raise ServerGoneError('it does not answer')
        self.claimed.append(question.goal.query_id)
        return SimpleNamespace(ok=True)

    def answer(self, question, decision):
        self.answers.append((question.goal.query_id, decision.state))
        self.free.remove(question.goal.query_id)
        return SimpleNamespace(ok=True, message='')

    def release(self, question):
        self.released.append(question.goal.query_id)


@pytest.mark.parametrize('free, found', [(['first', 'second'], 'first'), ([], None)])
def test_a_question_that_somebody_works_on_is_not_waited_for(free, found):
    question = wait_for_question(Asking(*free), 0.02)
    assert (question.goal.query_id if question else None) == found


def test_the_front_end_of_the_documentation_answers_what_nobody_works_on_and_outlives_a_server(
    monkeypatch,
):
    page = (Path(__file__).resolve().parents[3] / 'doc' / 'expert.md').read_text(encoding='utf-8')
    program = page.split('## A front end in')[1].split('```python\n')[1].split('```')[0]
    front_end = Asking('first', 'second', 'third', fails=1)
    typed = iter(['DETECT', 'DETECT'])

    def type_in(_prompt):
        answer = next(typed, None)
        if answer is None:
            raise KeyboardInterrupt
        return answer

    monkeypatch.setattr(module, 'FrontEnd', lambda _expert: front_end)
    monkeypatch.setattr(
        module,
        'wait_for_question',
        lambda each, timeout_s: wait_for_question(each, 0.0) or type_in(''),
    )
    monkeypatch.setattr(module.rospy, 'init_node', lambda *_, **__: None)
    monkeypatch.setattr(module.rospy.rostime, 'wallsleep', lambda _s: None)
    with pytest.raises(KeyboardInterrupt):
        exec(compile(program, 'expert.md', 'exec'), {'input': type_in})
    assert front_end.answers == [('first', 'DETECT'), ('second', 'DETECT')]
    assert (
        front_end.claimed == ['first', 'second', 'third'] and front_end.released[-1] == 'third'
    ), 'left by Ctrl-C'


@pytest.mark.parametrize('age', [float('inf'), float('-inf'), float('nan')])
def test_a_question_whose_server_tells_no_age_counts_as_new(age, monkeypatch):
    monkeypatch.setattr(followed_server.rospy, 'Subscriber', lambda *_, **__: None)
    monkeypatch.setattr(followed_server, 'publishers_of', lambda _topic: ['/robot'])
    monkeypatch.setattr(followed_server.time, 'monotonic', lambda: 50.0)
    server = followed_server.FollowedServer('/robot/expert_query', lambda: None)
    message = OpenQueries(queries=[OpenQuery(age=age, remaining=float('nan'))])
    message._connection_header = {'callerid': '/robot'}
    server._on_list(message)
    (listed,) = server.questions()
    assert (listed.asked_s, listed.deadline_s) == (50.0, float('inf'))
