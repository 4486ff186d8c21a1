"""When a node registers again with its master, and when it leaves it alone."""

import pytest

from smach_oracle.ros import master_watch
from smach_oracle.ros.master_watch import MasterCallError, MasterLink, MasterWatch, Registrations

ITEMS = Registrations(
    [['/task/oracle/events', 'smach_oracle/OracleEvent']],
    [['/task/expert_query/goal', 'smach_oracle/ExpertQueryActionGoal']],
    [('/task/expert_query/answer', 'rosrpc://localhost:1')],
)


class FakeLink:
    """A master as the watch sees it."""

    def __init__(self):
        self.pid = 100
        self.known = True
        self.error = None
        self.refuses = False
        self.registered = []

    def identity(self):
        if self.error is not None:
            raise self.error
        return self.pid, self.known

    def register(self, items):
        if self.refuses:
            raise MasterCallError('/task/oracle/events: no')
        self.registered.append(items)
        self.known = True
        return [(topic, ['http://localhost:2']) for topic, _ in items.subscriptions]


@pytest.fixture
def link():
    return FakeLink()


@pytest.fixture
def found():
    return []


@pytest.fixture
def watch(link, found, monkeypatch):
    monkeypatch.setattr(master_watch.rospy, 'logwarn', lambda *args: None)
    watch = MasterWatch(link, lambda: ITEMS, lambda topic, uris: found.append((topic, uris)))
    watch.check()
    return watch


def test_while_the_master_stays_nothing_is_registered_again(watch, link):
    for _ in range(5):
        watch.check()
    assert link.registered == []


def test_a_master_with_another_process_id_gets_everything_once(watch, link, found):
    link.pid = 200
    for _ in range(3):
        watch.check()
    assert link.registered == [ITEMS]
    assert found == [('/task/expert_query/goal', ['http://localhost:2'])]


def test_a_master_that_comes_back_with_the_same_process_id_is_noticed(watch, link):
    link.known = False  # as in a container, where it is always process 1
    watch.check()
    watch.check()
    assert link.registered == [ITEMS]


def test_a_master_that_was_away_gets_everything_even_if_it_knows_a_part(watch, link):
    link.error = ConnectionRefusedError('away')
    watch.check()
    link.error = None  # known: a publisher made in the meantime has registered itself
    watch.check()
    assert link.registered == [ITEMS]


def test_a_registration_that_fails_half_way_is_tried_again(watch, link):
    link.pid, link.refuses = 200, True
    watch.check()
    assert link.registered == []
    link.refuses = False
    watch.check()
    watch.check()
    assert link.registered == [ITEMS]


@pytest.mark.parametrize(
    'error', [OSError('no route'), ValueError('half an answer'), KeyError('odd')]
)
def test_whatever_a_dying_master_answers_the_watch_goes_on(watch, link, error):
    link.error = error
    watch.check()
    link.error = None
    watch.check()
    assert link.registered == [ITEMS]


def test_a_long_outage_is_told_once(watch, link, monkeypatch):
    said = []
    monkeypatch.setattr(master_watch.rospy, 'logwarn', lambda *args: said.append(args))
    link.error = ConnectionRefusedError('away')
    for _ in range(10):
        watch.check()
    assert len(said) == 1


class FakeMaster:
    """Notes the calls that register something."""

    def __init__(self):
        self.calls = []

    def __enter__(self):
        return self

    def __exit__(self, *_error):
        pass

    def __getattr__(self, method):
        def call(_caller, name, *_more):
            self.calls.append((method, name))
            return 1, '', ['http://localhost:2'] if method == 'registerSubscriber' else 0

        return call


def test_who_hears_from_a_node_again_finds_its_services_there(monkeypatch):
    master = FakeMaster()
    monkeypatch.setattr(master_watch.xmlrpc.client, 'ServerProxy', lambda *_, **__: master)
    found = MasterLink('http://localhost:1', '/task', 'http://localhost:3').register(ITEMS)
    assert found == [('/task/expert_query/goal', ['http://localhost:2'])]
    assert master.calls == [
        ('registerService', '/task/expert_query/answer'),
        ('registerSubscriber', '/task/expert_query/goal'),
        ('registerPublisher', '/task/oracle/events'),
    ]
