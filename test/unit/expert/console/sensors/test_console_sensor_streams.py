"""The closed set of sensors, and paced frames over real connections: refused, forged, flooded,
slow.
"""

import json
import time

import console_case
import numpy as np
import pytest
import tornado.testing
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import Header

from smach_oracle.expert.console.sensors import sample_handlers, sensor_streams
from smach_oracle.expert.console.sensors.sensor_streams import SensorStreams
from smach_oracle.expert.console.web.access import ClientRateLimits
from smach_oracle.ros.images import colour_image

PUBLISHED = [
    ['/camera/image', 'sensor_msgs/Image'],
    ['/joint_states', 'sensor_msgs/JointState'],
    ['/cmd_vel', 'geometry_msgs/Twist'],
    ['/secret', 'std_msgs/String'],
]


class FakeSubscriber:
    """Counts."""

    alive = 0

    def __init__(self, *_, **__):
        FakeSubscriber.alive += 1

    def unregister(self):
        FakeSubscriber.alive -= 1


@pytest.fixture(autouse=True)
def no_master(monkeypatch):
    FakeSubscriber.alive = 0
    monkeypatch.setattr(sensor_streams.rospy, 'Subscriber', FakeSubscriber)


def picture(level=100):
    return colour_image(np.full((48, 64, 3), level, np.uint8), Header(frame_id='camera'))


def known():
    found = SensorStreams()
    found.follow(PUBLISHED)
    return found


def test_topics_of_the_types_that_can_be_shown_are_known_and_no_others():
    assert [(each['topic'], each['kind']) for each in known().view()] == [
        ('/camera/image', 'image'),
        ('/joint_states', 'joints'),
    ]


def test_a_topic_that_changes_its_type_is_another_sensor_and_one_that_is_gone_is_forgotten():
    found = known()
    before = found.on('/camera/image').number
    for _ in range(5):
        found.follow([['/camera/image', 'sensor_msgs/CompressedImage']])
    assert [each['type'] for each in found.view()] == ['sensor_msgs/CompressedImage']
    assert found.find(before) is None and found.on('/camera/image').number != before


def test_there_are_only_so_many():
    found = SensorStreams()
    found.follow([['/camera{}'.format(number), 'sensor_msgs/Image'] for number in range(1000)])
    assert len(found.view()) == sensor_streams.MOST_SENSORS


def test_nothing_is_listened_to_unless_somebody_looks_and_not_for_longer(monkeypatch):
    found = known()
    found.update_subscriptions()
    assert FakeSubscriber.alive == 0
    sensor = found.on('/camera/image')
    assert sensor.newer(0) is None
    found.update_subscriptions()
    found.update_subscriptions()
    assert FakeSubscriber.alive == 1
    sensor.take(picture())
    later = time.monotonic() + sensor_streams.IDLE_S
    monkeypatch.setattr(sensor_streams.time, 'monotonic', lambda: later)
    found.update_subscriptions()
    assert FakeSubscriber.alive == 0
    assert sensor.newer(0) is None, 'what was seen long ago is not shown as new'


def test_only_so_many_are_listened_to_at_a_time():
    found = SensorStreams()
    found.follow([['/camera{}'.format(number), 'sensor_msgs/Image'] for number in range(50)])
    for each in found.view():
        found.find(each['id']).newer(0)
    found.update_subscriptions()
    assert FakeSubscriber.alive == sensor_streams.MOST_LISTENED


def test_the_newest_frame_alone_is_kept_and_encoded_once_for_all():
    sensor = known().on('/camera/image')
    for level in range(1, 6):
        sensor.take(picture(level))
    frame = sensor.newer(0)
    assert (frame.sequence, frame.message.data[0]) == (5, 5) and sensor.newer(5) is None
    assert sensor.newer(7) is not None, 'a page that knows an earlier console gets what there is'
    assert sensor.file_of(frame, 320) is sensor.file_of(frame, 320)
    sensor.take(picture())
    sensor.file_of(sensor.newer(5), 320)
    assert len(sensor._encoded) == 1


class TestSamples(console_case.ConsoleCase):
    def setUp(self):
        super().setUp()
        self.sensors.follow(PUBLISHED)
        self.camera = self.sensors.on('/camera/image')
        self.cookie, self.info = self.sign_in('viewer')

    def sample(self, path=None, **headers):
        given = dict({'Cookie': self.cookie, 'X_Xsrf': self.info['xsrf']}, **headers)
        return self.ask(path or '/sample/{}'.format(self.camera.number), **given)

    def test_a_viewer_gets_the_newest_frame(self):
        self.camera.take(picture(1))
        self.camera.take(picture(2))
        answer = self.sample()
        assert (answer.code, answer.headers['Content-Type']) == (200, 'image/jpeg')
        assert (
            answer.headers['Cache-Control'] == 'no-store'
            and answer.headers['X-Content-Type-Options'] == 'nosniff'
        )
        facts = json.loads(answer.headers['X-Facts'])
        assert (facts['sequence'], facts['size'], facts['stamp']) == (2, [64, 48], '0.000000000')

    def test_without_a_session_its_token_or_the_page_nothing_is_told(self):
        self.camera.take(picture())
        for headers, code in (
            ({'Cookie': None}, 401),
            ({'Cookie': self.begin()[0]}, 401),
            ({'X_Xsrf': None}, 403),
            ({'X_Xsrf': '0' * 64}, 403),
            ({'Origin': 'http://evil.example'}, 403),
            ({'Host': 'evil.example'}, 421),
        ):
            answer = self.sample(**headers)
            assert answer.code == code and 'X-Facts' not in answer.headers, headers

    def test_no_topic_can_be_named(self):
        for path in (
            '/sample/cmd_vel',
            '/sample//cmd_vel',
            '/sample/%2fsecret',
            '/sample/99',
            '/sample/-1',
            '/sample/0x1',
            '/sample/1/../2',
            '/sample/',
            '/sample/12345678901',
        ):
            assert self.sample(path).code == 404, path
        path = '/sample/{}?'.format(self.camera.number)
        for query in (
            'topic=/secret',
            'after=-1',
            'after=x',
            'after=1&after=2',
            'width=100000',
            'width=1e3',
            'width=',
            'after=' + '9' * 30,
            'after=%c2%b2',
        ):
            assert self.sample(path + query).code == 400, query
        assert FakeSubscriber.alive == 0

    def test_a_page_that_has_the_newest_waits_for_the_next(self):
        self.camera.take(picture())
        self.io_loop.call_later(0.3, self.camera.take, picture(9))
        begun_s = time.monotonic()
        answer = self.sample('/sample/{}?after=1'.format(self.camera.number))
        assert (
            json.loads(answer.headers['X-Facts'])['sequence'] == 2
            and time.monotonic() - begun_s >= 0.25
        )

    def test_where_nothing_comes_the_answer_is_empty(self):
        sample_handlers.WAIT_S, before = 0.1, sample_handlers.WAIT_S
        try:
            answer = self.sample()
        finally:
            sample_handlers.WAIT_S = before
        assert (answer.code, answer.body) == (204, b'')

    def test_what_cannot_be_shown_is_told_as_text(self):
        self.camera.take(Image(encoding='<script>', height=1, width=1))
        answer = self.sample()
        assert answer.code == 422 and answer.headers['Content-Type'].startswith('text/plain')

    def test_joints_are_json(self):
        joints = self.sensors.on('/joint_states')
        joints.take(JointState(name=['elbow'], position=[1.0]))
        answer = self.sample('/sample/{}'.format(joints.number))
        assert json.loads(answer.body)['joints'] == [['elbow', 1.0, None, None]]

    def test_a_flood_is_cut_off_and_does_not_shut_out_other_requests(self):
        self.camera.take(picture())
        self._app_room().limits = ClientRateLimits(rate=0.0, burst=3.0, for_all=5.0)
        assert [self.sample().code for _ in range(4)] == [200, 200, 200, 429]
        assert self.ask('/session').code == 200

    def test_changing_methods_do_nothing(self):
        for method in ('POST', 'PUT', 'DELETE'):
            assert (
                self.ask(
                    '/sample/{}'.format(self.camera.number),
                    method,
                    '',
                    Origin=self.origin,
                    Cookie=self.cookie,
                    X_Xsrf=self.info['xsrf'],
                ).code
                == 405
            )

    @tornado.testing.gen_test
    async def test_only_so_many_wait_at_a_time(self):
        url = self.get_url('/sample/{}'.format(self.camera.number))
        shared = self._app_room()
        shared.waiting['127.0.0.1'] = sample_handlers.MOST_WAITING_EACH
        answer = await self.http_client.fetch(
            url, headers={'Cookie': self.cookie, 'X-Xsrf': self.info['xsrf']}, raise_error=False
        )
        assert (
            answer.code == 503 and shared.waiting['127.0.0.1'] == sample_handlers.MOST_WAITING_EACH
        )

    def _app_room(self):
        rules = self._app.default_router.rules[0].target.rules
        return next(
            rule.target_kwargs['shared']
            for rule in rules
            if rule.target is sample_handlers.SampleHandler
        )
