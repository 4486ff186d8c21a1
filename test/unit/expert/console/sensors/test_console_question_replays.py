"""Replays of failures: whose they are, bounded, and what a hostile robot can make of them."""

import json
import math

import console_case
import cv2
import numpy as np
import pytest
import rospy
from expert_fixtures import make_question
from sensor_msgs.msg import CompressedImage, JointState
from std_msgs.msg import Header

from smach_oracle.expert.console.sensors import question_replays
from smach_oracle.expert.console.sensors.question_replays import QuestionReplays, kept_replay
from smach_oracle.expert.console.web.sections import PageSections
from smach_oracle.expert.followed_server import ListedQuestion
from smach_oracle.msg import FailureReplay, OpenQuery, OracleEvent
from smach_oracle.ros.expert.question_messages import to_goal

pytestmark = pytest.mark.usefixtures('no_master')
AT_S = 1000
JPEG = bytes(cv2.imencode('.jpg', np.full((24, 32, 3), 120, np.uint8))[1])


def replay_message(query_id='q1', images=((0, -1.0),), data=JPEG, **more):
    """A message with images of (camera, s after the failure)."""
    return FailureReplay(
        header=Header(stamp=rospy.Time(AT_S)),
        query_id=query_id,
        seconds=30.0,
        topics=['/eye', '/hand'],
        cameras=bytes(camera for camera, _ in images),
        images_came=[rospy.Time.from_sec(AT_S + time_s) for _, time_s in images],
        images=[CompressedImage(format='jpeg', data=data) for _ in images],
        **more,
    )


def moving(*positions_of_time):
    """Joint states of (s after the failure, names, positions)."""
    return {
        'joints_came': [rospy.Time.from_sec(AT_S + time_s) for time_s, _, _ in positions_of_time],
        'joints': [
            JointState(name=names, position=positions) for _, names, positions in positions_of_time
        ],
    }


def listed(robot='/alpha', query_id='q1'):
    goal = to_goal(make_question(query_id), robot, asked=rospy.Time(AT_S))
    return ListedQuestion(robot + '/expert_query', goal, OpenQuery.PENDING, '', 1.0, math.inf)


def section(replays, *questions):
    sections = PageSections()
    replays.write_sections(sections, questions)
    return sections.get('replays')


def test_a_question_has_the_replay_of_its_own_robot():
    replays = QuestionReplays()
    replays.taker('/alpha')(replay_message('q1'))
    replays.taker('/beta')(replay_message('q1', images=((1, -2.0),)))
    found = section(replays, listed('/alpha'), listed('/beta'), listed('/gamma'))
    frames = {key: replays.find(number).view['frames'] for key, number in found.items()}
    assert frames == {listed('/alpha').key: [(0, -1.0)], listed('/beta').key: [(1, -2.0)]}


def test_a_later_word_on_a_question_replaces_the_earlier():
    replays = QuestionReplays()
    for time_s in (-1.0, -2.0):
        replays.keep('/alpha', replay_message(images=((0, time_s),)))
    (number,) = section(replays, listed()).values()
    assert replays.find(number).view['frames'] == [(0, -2.0)]
    assert replays.find(number - 1) is None


def test_a_replay_with_nothing_in_it_is_not_kept():
    replays = QuestionReplays()
    replays.keep('/alpha', replay_message(images=()))
    assert section(replays, listed()) == {}


def test_only_so_many_and_so_many_bytes_are_kept(monkeypatch):
    monkeypatch.setattr(question_replays, 'MOST_KEPT', 5)
    monkeypatch.setattr(question_replays, 'MOST_BYTES', 3000)
    replays = QuestionReplays()
    for number in range(9):
        replays.keep('/alpha', replay_message('q{}'.format(number), data=bytes(100)))
    asked = [listed(query_id='q{}'.format(number)) for number in range(9)]
    assert list(section(replays, *asked)) == [each.key for each in asked[4:]]
    replays.keep('/alpha', replay_message('q8', data=bytes(2950)))
    assert list(section(replays, *asked)) == [asked[8].key]
    replays.keep('/alpha', replay_message('giant', data=bytes(3001)))
    assert section(replays, *asked, listed(query_id='giant')) == {}


def test_the_joints_that_moved_most_come_first_and_none_without_a_number():
    names = ['still', 'little', 'far', 'more', 'most', 'broken']
    states = moving(
        (-9.0, names, [1.0, 1.0, 1.0, 1.0, 1.0, math.nan]),
        (-8.0, names, [1.0, 1.1, 1.5, 1.7, -9.0, math.inf]),
        (-7.0, ['far'], []),
    )
    view = kept_replay(replay_message(**states)).view
    assert [curve['name'] for curve in view['joints']] == ['most', 'more', 'far', 'little']
    assert view['joints'][0]['samples'] == [(-9.0, 1.0), (-8.0, -9.0)]


def test_what_does_not_belong_to_a_failure_is_left_out():
    images = ((0, -31.0), (0, -30.0), (7, -3.0), (1, 0.1), (1, 5.0))
    events = [
        OracleEvent(
            kind=OracleEvent.FAILURE,
            state='PICK',
            header=Header(stamp=rospy.Time.from_sec(AT_S + time_s)),
        )
        for time_s in (-40.0, -0.5)
    ]
    kept = kept_replay(replay_message(images=images, events=events))
    assert kept.view['frames'] == [(0, -30.0), (1, 0.0)]
    assert len(kept.images) == 2
    assert [(event['t'], event['kind']) for event in kept.view['events']] == [(-0.5, 'failure')]


@pytest.mark.parametrize('seconds', [math.nan, math.inf, -5.0, 1e9])
def test_a_view_is_plain_json_whatever_a_robot_says(seconds):
    message = replay_message(images=((0, -0.5),) * 3000)
    message.seconds, message.topics = seconds, ['x' * 1000] * 99
    view = kept_replay(message).view
    assert json.loads(json.dumps(view, allow_nan=False))['seconds'] in (1.0, 600.0)
    assert len(view['frames']) == question_replays.MOST_FRAMES
    assert [len(topic) for topic in view['cameras']] == [200] * 4


def test_lists_of_different_lengths_cost_nothing():
    message = replay_message(images=((0, -1.0),) * 3, **moving((-1.0, ['a', 'b'], [1.0])))
    message.cameras, message.joints_came = b'\0', message.joints_came * 9
    kept = kept_replay(message)
    assert (len(kept.view['frames']), len(kept.images)) == (1, 1)
    assert [curve['name'] for curve in kept.view['joints']] == ['a']


class Requests(console_case.ConsoleCase):
    """Over HTTP, as a page asks."""

    def look(self, path):
        cookie, said = self.sign_in('viewer')
        return self.ask(path, Cookie=cookie, X_Xsrf=said['xsrf'])

    def kept(self, message):
        """The number of a message that is kept."""
        self.replays.keep('/alpha', message)
        return section(self.replays, listed())[listed().key]

    def test_a_page_gets_facts_and_images(self):
        path = '/replay/{}'.format(self.kept(replay_message(images=((0, -2.0), (1, -1.0)))))
        answer = self.look(path)
        assert answer.code == 200
        assert json.loads(answer.body)['frames'] == [[0, -2.0], [1, -1.0]]
        image = self.look(path + '/1')
        assert (image.code, image.headers['Content-Type']) == (200, 'image/jpeg')
        assert image.body != JPEG, "none of a robot's bytes reaches a browser"
        assert cv2.imdecode(np.frombuffer(image.body, np.uint8), 1).shape == (24, 32, 3)

    def test_what_is_not_there_or_cannot_be_shown_is_refused(self):
        number = self.kept(replay_message(data=b'<script>'))
        codes = {
            path: self.look('/replay/' + path.format(number)).code
            for path in ('99999', '{}/1', '{}/0', '{}?x=1', 'x')
        }
        assert codes == {'99999': 404, '{}/1': 404, '{}/0': 422, '{}?x=1': 400, 'x': 404}

    def test_nobody_gets_one_without_signing_in(self):
        self.replays.keep('/alpha', replay_message())
        assert self.ask('/replay/1').code in (401, 403)
        assert self.ask('/replay/1/0').code in (401, 403)
