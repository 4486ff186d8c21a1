"""What is too old for an answer, and what the pages are told of it."""

from types import SimpleNamespace

import pytest
import rospy
from expert_fixtures import make_question

from smach_oracle.expert.console.answering import last_heard
from smach_oracle.expert.console.answering.last_heard import LastHeard
from smach_oracle.expert.console.commands.commands import COMMANDS, PageCommand
from smach_oracle.expert.console.web.sections import PageSections
from smach_oracle.expert.followed_server import ListedQuestion, ListNews
from smach_oracle.ros.expert.question_messages import to_goal

NOW_S = 100.0


class Everybody:
    """Heard when it is said; the parts are as LastHeard asks for them."""

    def __init__(self):
        self.master_s = self.server_s = self.node_s = NOW_S
        self.followed = set()
        goal = to_goal(make_question('q'), '/robot', asked=rospy.Time(1))
        self.listed = ListedQuestion('/robot/expert_query', goal, 1, '', 0.0, 1e9)
        self.servers = ['/robot/expert_query']

    def questions(self):
        return [self.listed]

    def news(self, name):
        return ListNews(self.server_s, 0.0)

    def follow(self, nodes):
        self.followed = set(nodes)

    def heard_s(self, node):
        return self.node_s


@pytest.fixture(name='everybody')
def make_everybody(monkeypatch):
    monkeypatch.setattr(last_heard, 'time', SimpleNamespace(monotonic=lambda: NOW_S))
    return Everybody()


def made_of(everybody, nodes=None):
    return LastHeard(everybody, everybody, lambda: nodes or {}, lambda: everybody.master_s)


def refusal(everybody, name='answer', **arguments):
    made = made_of(everybody)
    made.write_sections(PageSections())
    return made.refusal(PageCommand(1, name, arguments), everybody.listed)


def test_nothing_is_refused_while_all_are_heard(everybody):
    everybody.master_s = everybody.server_s = everybody.node_s = NOW_S - 5.0
    assert refusal(everybody, seen=NOW_S - 5.0) == ''


@pytest.mark.parametrize(
    'who, told',
    [
        ('master_s', 'The ROS master has been silent for 7 s'),
        ('server_s', '/robot/expert_query has been silent for 7 s'),
        ('node_s', '/robot has been silent for 7 s'),
    ],
)
def test_an_answer_to_who_is_silent_is_refused_with_the_reason(everybody, who, told):
    setattr(everybody, who, NOW_S - 7.0)
    assert refusal(everybody).startswith(told)
    assert refusal(everybody, 'hand_over').startswith(told)


def test_to_stop_and_to_let_go_is_never_refused(everybody):
    everybody.master_s = everybody.server_s = everybody.node_s = 0.0
    for name in set(COMMANDS) - {'answer', 'hand_over'}:
        assert refusal(everybody, name) == '', name


def test_who_was_never_heard_is_believed(everybody):
    everybody.node_s = everybody.master_s = None
    assert refusal(everybody) == ''


def test_an_answer_that_was_long_on_its_way_is_refused(everybody):
    assert 'what the page knew 20 s ago' in refusal(everybody, seen=NOW_S - 20.0)


def test_the_pages_are_told_the_ages_and_a_beat(everybody):
    everybody.master_s, everybody.node_s = NOW_S - 2.0, None
    sections = PageSections()
    made_of(everybody, {'/other': ['/a', '/b']}).write_sections(sections)
    assert sections.get('heard') == {
        'beat': NOW_S,
        'master': 2.0,
        'servers': {'/robot/expert_query': 0.0},
        'robots': {'/robot': None, '/other': None},
    }
    assert everybody.followed == {'/robot', '/a', '/b'}


def test_a_server_that_was_long_silent_is_told_of_as_soon_as_it_is_heard(everybody, monkeypatch):
    made, sections = made_of(everybody), PageSections()
    everybody.server_s = NOW_S - 3600.0
    made.write_sections(sections)
    monkeypatch.setattr(last_heard, 'time', SimpleNamespace(monotonic=lambda: NOW_S + 0.2))
    made.write_sections(sections)
    assert sections.get('heard')['servers'] == {'/robot/expert_query': 3600.0}, 'no beat is due'
    everybody.server_s = NOW_S + 0.1
    made.write_sections(sections)
    assert sections.get('heard')['servers'] == {'/robot/expert_query': 0.1}
