"""Calls from end to end: an on-call file, real servers, and the section that the pages show."""

import logging
import math

import pytest
import receiving
import rospy
from expert_fixtures import make_question
from receiving import PASSWORD
from waiting import stays, wait_for

from smach_oracle.expert.console.reach import outbox, reach
from smach_oracle.expert.console.reach.on_call import read_on_call
from smach_oracle.expert.console.reach.reach import Reach
from smach_oracle.expert.console.sensors.images import BrowserFile
from smach_oracle.expert.console.web.sections import PageSections
from smach_oracle.expert.followed_server import ListedQuestion
from smach_oracle.msg import OpenQuery
from smach_oracle.ros.expert.question_messages import to_goal

FILE = """
secrets: secrets
people:
  ann: {webhook: one}
  bob: {webhook: two, form: slack}
order:
  - {call: ann}
  - {call: bob, after_s: %s}
pictures: %s
"""


class Calls:
    """A console's calls: its open questions, and who is called."""

    def __init__(self, folder, one, two, after_s=0.3, pictures='false'):
        (folder / 'secrets').write_text('one {}\ntwo {}\n'.format(one, two))
        (folder / 'secrets').chmod(0o600)
        (folder / 'on_call.yaml').write_text(FILE % (after_s, pictures))
        self.questions, self.working, self.pictures = [], set(), {}
        self.sections = PageSections()
        self.reach = Reach(
            read_on_call(str(folder / 'on_call.yaml')),
            'https://robots.example.org',
            self.sections,
            lambda: self.questions,
            lambda listed: listed.key not in self.working,
            self.pictures.get,
        )

    def ask(self, query_id='q1'):
        goal = to_goal(make_question(query_id), '/robot', rospy.Time(1))
        self.questions.append(
            ListedQuestion('/robot/query', goal, OpenQuery.PENDING, '', 10.0, math.inf)
        )

    def until(self, condition):
        """Look again and again, as the console does."""
        return wait_for(lambda: self.reach.look() or condition())

    def shown(self):
        return self.sections.get('reach')

    def status(self, name, key='/robot/query q1'):
        found = [each for each in self.shown()['calls'].get(key, []) if name in each['to']]
        return (found[0]['status'], found[0]['why']) if found else None


@pytest.fixture
def servers(monkeypatch):
    monkeypatch.setattr(outbox.Outbox.__init__, '__defaults__', (outbox.deliver, 0.1, (0.1, 0.1)))
    made = [receiving.WebhookServer(), receiving.WebhookServer()]
    yield made
    for each in made:
        each.stop()


@pytest.fixture
def begin(servers, tmp_path):
    made = []

    def make(one=None, two=None, **more):
        urls = [one or servers[0].url, two or servers[1].url]
        made.append(Calls(tmp_path, *urls, **more))
        return made[-1]

    yield make
    for each in made:
        each.reach.stop()


def test_the_first_is_called_and_the_next_after_a_time(begin, servers):
    calls = begin()
    calls.reach.look()
    assert calls.shown() == {'calls': {}, 'next': {}, 'failed': []}
    calls.ask()
    assert calls.until(lambda: calls.status('ann') == ('sent', ''))
    assert calls.until(lambda: calls.status('bob by slack') == ('sent', ''))
    assert [len(server.taken) for server in servers] == [1, 1]
    assert calls.shown()['next'] == {}, 'nobody comes after him'
    calls.questions.clear()
    calls.reach.look()
    assert calls.shown()['calls'] == {}


def test_the_page_shows_who_comes_next_and_when(begin):
    calls = begin(after_s=500)
    calls.ask()
    assert calls.until(lambda: calls.status('ann') == ('sent', ''))
    (following,) = calls.shown()['next'].values()
    assert following['people'] == ['bob']
    version = calls.sections.version
    assert stays(lambda: calls.reach.look() or calls.sections.version == version, 0.5)


def test_nobody_is_called_for_a_question_on_which_somebody_works(begin, servers):
    calls = begin()
    calls.working.add('/robot/query q1')
    calls.ask()
    assert stays(lambda: calls.reach.look() or not servers[0].taken, 0.5)
    calls.working.clear()
    assert calls.until(lambda: calls.status('ann') == ('sent', ''))


def test_a_receiver_that_fails_is_shown_and_the_next_is_called(begin, servers, caplog):
    caplog.set_level(logging.DEBUG)
    servers[0].statuses = [500]
    calls = begin()
    calls.ask()
    assert calls.until(lambda: calls.status('ann') == ('failed', 'it answered with status 500'))
    assert len(servers[0].taken) == 3, 'it was tried again, and not forever'
    assert calls.until(lambda: calls.status('bob') == ('sent', ''))
    (failed,) = calls.shown()['failed']
    assert (failed['to'], failed['why']) == ('ann by json', 'it answered with status 500')
    assert 'ann by json was not reached' in caplog.text
    assert PASSWORD not in caplog.text and PASSWORD not in str(calls.shown())
    calls.questions.clear()
    calls.reach.look()
    assert calls.shown()['failed'], 'it stays when the question is gone'


def test_the_next_is_called_at_once_where_the_first_cannot_be_reached(begin, servers):
    servers[0].statuses = [404]
    calls = begin(after_s=5000)
    calls.ask()
    assert calls.until(lambda: calls.status('bob') == ('sent', ''))


def test_a_receiver_that_hangs_delays_nothing(begin, servers):
    rude = receiving.RudeServer(receiving.hangs)
    calls = begin(one='http://127.0.0.1:{}/x'.format(rude.port))
    try:
        calls.ask()
        assert calls.until(lambda: calls.status('bob') == ('sent', ''))
        assert calls.status('ann') == ('waiting', '')
    finally:
        rude.stop()


def test_a_picture_is_waited_for_a_little_and_sent(begin, servers):
    calls = begin(pictures='true')
    calls.ask()
    assert stays(lambda: calls.reach.look() or not servers[0].taken, 0.5)
    calls.pictures['/robot/query q1'] = BrowserFile('image/jpeg', b'x', {})
    assert calls.until(lambda: servers[0].taken)
    assert servers[0].taken[0][1]['questions'][0]['picture']['type'] == 'image/jpeg'


def test_who_has_no_camera_is_called_without(begin, servers, monkeypatch):
    monkeypatch.setattr(reach, 'PICTURE_WAIT_S', 0.3)
    calls = begin(pictures='true')
    calls.ask()
    assert calls.until(lambda: servers[0].taken)
    assert servers[0].taken[0][1]['questions'][0]['picture'] is None


def test_a_picture_stays_on_the_machine_where_the_list_says_so(begin, servers):
    calls = begin(pictures='false')
    calls.pictures['/robot/query q1'] = BrowserFile('image/jpeg', b'x', {})
    calls.ask()
    assert calls.until(lambda: servers[0].taken)
    assert servers[0].taken[0][1]['questions'][0]['picture'] is None
