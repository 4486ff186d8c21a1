"""What the page is told of questions, events and rates; what people's values become; sections."""
import json
import math

import pytest
from expert_fixtures import make_question
from geometry_msgs.msg import PointStamped
from smach_msgs.msg import SmachContainerStatus, SmachContainerStructure

from smach_oracle.expert.console import robots, sessions
from smach_oracle.expert.console import sections as sections_module
from smach_oracle.expert.console.checks import Output
from smach_oracle.expert.console.desk import BadOutput, items
from smach_oracle.expert.console.helped import Score
from smach_oracle.expert.console.questions import QuestionBoard
from smach_oracle.expert.console.robot import Robot
from smach_oracle.expert.console.sections import Sections
from smach_oracle.expert.console.trial_log import TrialLog
from smach_oracle.expert.console.views import event_of, event_view, question_view
from smach_oracle.expert.followed_server import Listed
from smach_oracle.msg import OpenQuery, OracleEvent, OracleRates, StateRate, TransitionCount
from smach_oracle.oracle.events import EventKind
from smach_oracle.ros.question_messages import to_goal
from smach_oracle.ros.userdata_codec import decode_all


def goal(**changes):
    import rospy
    return to_goal(make_question(**changes), '/robot', rospy.Time(1))


def view(**changes):
    listed = Listed('/robot/expert_query', goal(**changes), OpenQuery.CLAIMED, 'ann', 10.0, math.inf)
    return question_view(listed, 1000.0, lambda target: Score(2, 3) if target == 'DETECT' else Score(0, 0))


def test_a_question_is_told_whole():
    told = view()
    assert json.loads(json.dumps(told, allow_nan=False)) == told
    assert (told['key'], told['state'], told['asked'], told['deadline'], told['holder'], told['status']) == (
        '/robot/expert_query q1', 'PICK', 1010.0, None, 'ann', 'claimed')
    detect, pick, place = told['choices']
    assert detect['helped'] == [2, 3] and pick['missing'] == ['grasp'] and place['blocked']
    assert pick['preconditions'] == ['MOVE_ARMS_ASIDE', 'view_is_clear']
    assert told['supersede'][0] == {'outcome': 'succeeded', 'target': 'PLACE'}
    assert told['outputs'] == ['grasped']
    assert told['interfaces'] == [{'name': 'assist', 'description': 'do it by hand'}]


class FakeFrontEnd:
    servers = ()
    connected = None

    def __init__(self):
        self.asked = {}

    def questions(self):
        return sorted((Listed('/robot/expert_query', goal(query_id=name), OpenQuery.PENDING, '', asked_s, math.inf)
                       for name, asked_s in self.asked.items()), key=lambda listed: listed.asked_s)


def test_questions_of_one_second_keep_their_places_though_each_list_tells_their_ages_anew():
    front_end, sections = FakeFrontEnd(), Sections()
    board = QuestionBoard(front_end, TrialLog())
    for front_end.asked in ({'q1': 10.0, 'q2': 10.1}, {'q1': 10.2, 'q2': 10.1}, {'q1': 10.2, 'q2': 9.9, 'q3': 9.0}):
        board.draw(sections)
        shown = [view['key'].split()[1] for view in json.loads(dict(sections.since(0)[1])['questions'])]
        assert [key for key in shown if key != 'q3'] == ['q1', 'q2']
    assert shown == ['q3', 'q1', 'q2']


def test_userdata_is_shown_by_kind():
    point = PointStamped()
    point.header.frame_id = 'base_link'
    told = {item['key']: item for item in view(userdata={'plain': {'a': 1}, 'point': point, 'points': [point, point],
                                                         'image': object()})['userdata']}
    assert told['plain']['value'] == '{"a": 1}' and told['image']['note'] == 'not sent'
    assert 'frame_id: "base_link"' in told['point']['value']
    assert told['points']['type'] == 'geometry_msgs/PointStamped[]'


def test_markup_and_odd_numbers_are_data_like_any_other():
    told = view(text='<script>alert(1)</script>', rate=math.nan)
    assert told['text'] == '<script>alert(1)</script>' and told['rate'] is None
    assert len(view(text='x' * 100000)['text']) < 10000


@pytest.mark.parametrize('kind', list(EventKind))
def test_every_kind_of_event_has_words(kind):
    message = OracleEvent(kind=int(kind), path='TASK', state='PICK', outcome='aborted', target='PLACE', by='ann',
                          rate=math.nan)
    told = event_view(event_of(message))
    assert told['kind'] == kind.name.lower() and told['words'].endswith('.') or kind == EventKind.WARNING
    json.dumps(told, allow_nan=False)


def test_a_kind_of_a_later_release_does_no_harm():
    assert event_view(event_of(OracleEvent(kind=99, rate=math.inf)))['kind'] == '99'


def test_typed_values_become_userdata_messages_among_them():
    asked = goal(userdata={'point': PointStamped(), 'points': [PointStamped()]})
    decoded = decode_all(items([Output('a', [1, None], ''),
                                Output('b', {'point': {'x': 1.5}}, 'geometry_msgs/PointStamped'),
                                Output('c', [{}, {}], 'geometry_msgs/PointStamped[]')], asked))
    assert decoded['a'] == [1, None] and decoded['b'].point.x == 1.5 and len(decoded['c']) == 2


@pytest.mark.parametrize('value, kind', [
    ({}, 'std_msgs/String'), ({}, 'os/path'), ({'nothing': 1}, 'geometry_msgs/PointStamped'),
    (5, 'geometry_msgs/PointStamped'), ({'point': {'x': 'text'}}, 'geometry_msgs/PointStamped'),
    ([], 'geometry_msgs/PointStamped[]'), ({}, 'geometry_msgs/PointStamped[]')])
def test_a_value_that_fits_no_message_of_the_question_is_refused(value, kind):
    with pytest.raises(BadOutput, match='output a'):
        items([Output('a', value, kind)], goal(userdata={'point': PointStamped(), 'points': [PointStamped()]}))


def test_a_section_is_sent_again_only_when_it_has_changed():
    sections = Sections()
    sections.put('a', [1])
    version, changed = sections.since(0)
    assert changed == [('a', '[1]')]
    sections.put('a', [1])
    assert sections.since(version) == (version, [])
    sections.put('a', None)
    later, changed = sections.since(version)
    assert later > version and changed == [('a', 'null')] and sections.since(0)[1] == []


def test_of_sections_that_are_gone_the_latest_are_remembered(monkeypatch):
    monkeypatch.setattr(sections_module, '_MOST_GONE', 10)
    sections = Sections()
    sections.put('stays', 1)
    for number in range(100):
        sections.put('robot {}'.format(number), 1)
        version = sections.version
        sections.put('robot {}'.format(number), None)
    assert sections.since(version) == (201, [('robot 99', 'null')])
    assert len(sections._sections) <= 12 and sections.get('stays') == 1


class NoLayouter:
    def find(self, text, done):
        return None


def test_a_robot_s_topics_become_its_sections():
    robot, sections = Robot('/robot'), Sections()
    robot.on_structure(SmachContainerStructure(path='/TASK', children=['A', 'B'], outcomes_from=['A'],
                                               internal_outcomes=['ok'], outcomes_to=['B'],
                                               container_outcomes=['done']))
    robot.on_structure(SmachContainerStructure(path='/TASK/B', children=['C']))
    robot.on_status(SmachContainerStatus(path='/TASK', active_states=['B']))
    robot.on_rates(OracleRates(states=[StateRate('TASK', 'A', 0.25, 1, 3, 1, 0, False),
                                       StateRate('UNSEEN', 'X', 0.1, 1, 0, 0, 0, False)],
                               transitions=[TransitionCount('TASK', 'A', 'ok', 'B', 3)]))
    robot.on_event(OracleEvent(kind=OracleEvent.FAILURE, path='TASK', state='A', rate=0.25))
    robot.draw(sections, NoLayouter())
    live = sections.get('live /robot')
    assert live['active'] == {'TASK': ['B']} and live['failed']['TASK']['state'] == 'A'
    assert live['rates']['TASK']['A']['rate'] == 0.25 and live['counts']['TASK'] == [['A', 'ok', 'B', 3, 1.0]]
    assert live['paths'] == ['TASK', 'TASK/B', 'UNSEEN'], 'without introspection what is learned tells of a machine'
    assert [state['nested'] for state in sections.get('graph /robot TASK')['states']] == [False, True]
    robot.on_event(OracleEvent(kind=OracleEvent.JUMP, path='TASK', state='A', target='B'))
    robot.draw(sections, NoLayouter())
    assert sections.get('live /robot')['failed'] == {}
    robot.forget(sections)
    assert sections.since(0)[1] == []


class FakeSubscriber:
    made, unregistered = [], []

    def __init__(self, topic, message, callback, queue_size):
        self.topic, self.callback = topic, callback
        self.made.append(self)

    def unregister(self):
        self.unregistered.append(self.topic)


def test_robots_are_found_by_name_and_type_and_the_oldest_of_many_that_are_gone_are_forgotten(monkeypatch):
    monkeypatch.setattr(robots.rospy, 'Subscriber', FakeSubscriber)
    monkeypatch.setattr(robots, 'MOST_ROBOTS', 2)
    sections, log = Sections(), TrialLog()
    found = robots.Robots(sections, log, NoLayouter())
    events = OracleEvent._type
    found.follow([['/a/oracle/events', events], ['/b/oracle/events', 'std_msgs/String'], ['/c/other', events],
                  ['/oracle/events', events]])
    found.draw()
    assert sections.get('robots') == ['/a']
    next(each for each in FakeSubscriber.made if each.topic == '/a/oracle/events').callback(
        OracleEvent(kind=OracleEvent.STATE_START, trial_id='t', path='TASK', state='A'))
    found.draw()
    assert sections.get('live /a')['alive'] and log.overview()['trials'][0]['robot'] == '/a'
    for name in 'defg':
        found.follow([['/{}/oracle/events'.format(name), events]])
    found.follow([])
    found.follow([])
    found.draw()
    assert sections.get('robots') == ['/f', '/g'] and sections.get('live /a') is None
    assert '/a/oracle/events' in FakeSubscriber.unregistered and not sections.get('live /g')['alive']


def test_a_session_survives_its_cookie_and_nothing_else_becomes_one():
    session = sessions.new_session()
    assert sessions.from_text(sessions.to_text(session).encode()) == session
    assert sessions.from_text(b'["a",1.0,"operator",""]') == sessions.Session('a', 1.0, 'operator')
    for text in (None, b'', b'{', b'[]', b'[1,2,3,4]', b'["a",1.0,"root",""]', b'{"id": 1}', b'["a",1.0,"operator"]',
                 b'["a","operator",""]', b'["a","1.0","operator",""]', b'["a",true,"operator",""]',
                 b'["a",null,"operator",""]', b'["a",NaN,"operator",""]', b'["a",Infinity,"operator",""]',
                 b'["a",1e999,"operator",""]', b'[["a"],1.0,"operator",""]', b'["a",1.0,["operator"],""]'):
        assert sessions.from_text(text) is None, text
    assert sessions.xsrf_token(session, 'a') != sessions.xsrf_token(session, 'b')
    assert session.id not in session.short
