"""Outboxes: bounded tries, one that hangs delays nobody, a fleet that fails sends one message."""

import threading
import time

import pytest
from waiting import stays, wait_for

from smach_oracle.expert.console.reach import outbox as module
from smach_oracle.expert.console.reach.calls_text import CalledQuestion
from smach_oracle.expert.console.reach.delivery import NotDelivered
from smach_oracle.expert.console.reach.on_call import OnCallList, Receiver
from smach_oracle.expert.console.reach.outbox import DROPPED, FAILED, SENT, WAITING, Outbox
from smach_oracle.expert.console.reach.secret_file import Secret


def question(key):
    return CalledQuestion(key, '/r', 'TASK', 'PICK', 'PICK failed.', 'http://x/', 1.0)


class Sent:
    """An outbox whose messages a test takes, and fails, as it likes."""

    def __init__(self, gather_s=0.0, retry_after_s=(0.0, 0.0, 0.0)):
        self.messages, self.results, self.errors = [], [], []
        self.waiting = {'a', 'b', 'c'}
        self.go_on = threading.Event()
        self.go_on.set()
        self.box = Outbox(
            Receiver('ann', 'json', Secret('http://x/')),
            OnCallList({}, ()),
            lambda key: key in self.waiting,
            lambda result: self.results.append((result.key, result.status, result.why)),
            self.send,
            gather_s,
            retry_after_s,
        )

    def send(self, receiver, questions, on_call):
        self.messages.append([each.key for each in questions])
        assert self.go_on.wait(40.0)
        if self.errors:
            raise self.errors.pop(0)

    def has(self, *result):
        return wait_for(lambda: result in self.results)


@pytest.fixture
def make():
    made = []

    def begin(**more):
        made.append(Sent(**more))
        return made[-1]

    yield begin
    for each in made:
        each.go_on.set()
        each.box.stop()


def test_a_message_that_fails_is_sent_again_and_then_given_up(make):
    sent = make()
    sent.errors = [NotDelivered('no {}'.format(number)) for number in range(9)]
    sent.box.add(question('a'))
    assert sent.has('a', FAILED, 'no 3')
    assert sent.messages == [['a']] * 4, 'and not forever'
    assert sent.results[:2] == [('a', WAITING, ''), ('a', WAITING, 'no 0')]


def test_what_never_succeeds_is_not_tried_again(make):
    sent = make()
    sent.errors = [NotDelivered('no', final=True)]
    sent.box.add(question('a'))
    assert sent.has('a', FAILED, 'no') and sent.messages == [['a']]


def test_a_message_that_succeeds_at_last_is_sent(make):
    sent = make()
    sent.errors = [NotDelivered('no')]
    sent.box.add(question('a'))
    assert sent.has('a', SENT, '') and sent.messages == [['a'], ['a']]


def test_questions_that_come_meanwhile_are_one_message(make):
    sent = make()
    sent.go_on.clear()
    sent.box.add(question('a'))
    assert wait_for(lambda: sent.messages == [['a']])
    sent.box.add(question('b'))
    sent.box.add(question('c'))
    sent.go_on.set()
    assert sent.has('c', SENT, '') and sent.messages == [['a'], ['b', 'c']]


def test_there_is_a_time_between_two_messages(make):
    sent = make(gather_s=1.0)
    sent.box.add(question('a'))
    assert sent.has('a', SENT, '')
    sent.box.add(question('b'))
    assert stays(lambda: len(sent.messages) == 1, 0.5)
    assert sent.has('b', SENT, '')


def test_nobody_is_called_about_a_question_to_which_somebody_has_come(make):
    sent = make()
    sent.go_on.clear()
    sent.errors = [NotDelivered('no')]
    sent.box.add(question('a'))
    assert wait_for(lambda: sent.messages)
    sent.waiting.discard('a')
    sent.go_on.set()
    assert sent.has('a', DROPPED, '') and sent.messages == [['a']]


def test_one_that_hangs_delays_no_other_and_not_who_adds_to_it(make):
    hanging, other = make(), make()
    hanging.go_on.clear()
    hanging.box.add(question('a'))
    assert wait_for(lambda: hanging.messages)
    begun_s = time.monotonic()
    for number in range(100):
        hanging.box.add(question(str(number)))
    assert time.monotonic() - begun_s < 1.0
    other.box.add(question('a'))
    assert other.has('a', SENT, '')


def test_very_many_that_wait_are_bounded(make, monkeypatch):
    monkeypatch.setattr(module, 'MOST_WAITING', 3)
    sent = make()
    sent.go_on.clear()
    sent.box.add(question('a'))
    assert wait_for(lambda: sent.messages)
    for number in range(4):
        sent.box.add(question(str(number)))
    assert sent.results[-1] == ('3', FAILED, 'too many wait to be sent')


def test_one_that_is_stopped_sends_nothing_more(make):
    sent = make(gather_s=60.0)
    sent.box.add(question('a'))
    assert sent.has('a', SENT, '')
    sent.box.add(question('b'))
    sent.box.stop()
    assert stays(lambda: sent.messages == [['a']], 0.3)
