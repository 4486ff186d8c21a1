"""What cameras saw when questions were put, and how preconditions stand: kept, bounded, of whom
they are.
"""

import numpy as np
import pytest
from expert_fixtures import make_question
from sensor_msgs.msg import CompressedImage
from std_msgs.msg import Header

from smach_oracle.expert.console.answering import precondition_sections
from smach_oracle.expert.console.answering.precondition_sections import PreconditionStatuses
from smach_oracle.expert.console.sensors import question_images
from smach_oracle.expert.console.sensors.images import BrowserFile
from smach_oracle.expert.console.sensors.question_images import ImageStore, QuestionImages
from smach_oracle.expert.console.sensors.sensor_streams import SensorStreams
from smach_oracle.expert.console.web.sections import PageSections
from smach_oracle.expert.followed_server import ListedQuestion
from smach_oracle.msg import FailureFrames, OpenQuery, PreconditionCheck, PreconditionChecks
from smach_oracle.ros.expert.failure_images import compressed
from smach_oracle.ros.expert.question_messages import to_goal
from smach_oracle.ros.images import colour_image

pytestmark = pytest.mark.usefixtures('no_master')


def listed(monkeypatch, robot='/alpha', asked_s=100.0, query_id='q1', stamp_s=1):
    monkeypatch.setattr(question_images.time, 'monotonic', lambda: 100.5)
    goal = to_goal(make_question(query_id), robot, asked=question_images.rospy.Time(stamp_s))
    return ListedQuestion(
        robot + '/expert_query', goal, OpenQuery.PENDING, '', asked_s, float('inf')
    )


def picture(level=100, stamp_s=0.0):
    return colour_image(
        np.full((48, 64, 3), level, np.uint8),
        Header(frame_id='camera', stamp=question_images.rospy.Time.from_sec(stamp_s)),
    )


def seen(*topics):
    found = SensorStreams()
    found.follow([[topic, 'sensor_msgs/Image'] for topic in topics])
    return found


def shown(board, question):
    sections = PageSections()
    board.write_sections(sections, [question])
    return sections.get('images').get(question.key, [])


def test_the_console_takes_the_first_frame_after_the_question(monkeypatch):
    found = seen('/alpha/head/rgb/image_raw', '/alpha/head/depth/image_raw')
    board, question = QuestionImages(ImageStore(), found), listed(monkeypatch)
    assert shown(board, question) == []
    found.on('/alpha/head/rgb/image_raw').take(picture())
    first = shown(board, question)
    assert [(each['topic'], each['late'], each['size']) for each in first] == [
        ('/alpha/head/rgb/image_raw', 0.5, [64, 48])
    ]
    found.on('/alpha/head/rgb/image_raw').take(picture(200))
    assert shown(board, question) == first, 'one frame, and it stays'


def test_a_console_that_comes_late_shows_nothing_for_the_failure(monkeypatch):
    found = seen('/alpha/head/rgb/image_raw')
    found.on('/alpha/head/rgb/image_raw').take(picture())
    assert shown(QuestionImages(ImageStore(), found), listed(monkeypatch, asked_s=50.0)) == []


def test_the_last_frame_of_a_camera_that_died_before_is_none_of_the_question(monkeypatch):
    found = seen('/alpha/head/rgb/image_raw')
    board, question = QuestionImages(ImageStore(), found), listed(monkeypatch)
    monkeypatch.setattr(question_images.time, 'monotonic', lambda: 97.0)
    found.on('/alpha/head/rgb/image_raw').take(picture())
    monkeypatch.setattr(question_images.time, 'monotonic', lambda: 100.5)
    assert shown(board, question) == []
    found.on('/alpha/head/rgb/image_raw').take(picture())
    assert [each['late'] for each in shown(board, question)] == [0.5]


def test_the_robot_is_believed_first_and_about_its_own_question_alone(monkeypatch):
    found = seen('/alpha/head/rgb/image_raw')
    found.on('/alpha/head/rgb/image_raw').take(picture())
    board, question = QuestionImages(ImageStore(), found), listed(monkeypatch)
    message = FailureFrames(query_id='q1', topics=['/wrist'], images=[compressed(picture())])
    board.taker('/beta')(message)
    assert [each['topic'] for each in shown(board, question)] == ['/alpha/head/rgb/image_raw']
    board.taker('/alpha')(message)
    assert [(each['topic'], each['late']) for each in shown(board, question)] == [('/wrist', None)]


def test_bytes_of_a_robot_reach_nobody_as_they_came(monkeypatch):
    files = ImageStore()
    board = QuestionImages(files, SensorStreams())
    evil = CompressedImage(format='jpeg', data=b'<script>window.hacked = 1</script>')
    good = compressed(picture())
    good.data = good.data + b'<script>'
    board.taker('/alpha')(
        FailureFrames(query_id='q1', topics=['/evil', '/good'], images=[evil, good])
    )
    question = listed(monkeypatch)
    assert [each['topic'] for each in shown(board, question)] == ['/good']
    kept = files.find(shown(board, question)[0]['id'])
    assert kept.content_type == 'image/jpeg' and b'<script>' not in kept.body


def test_files_are_bounded_in_number_and_bytes(monkeypatch):
    files = ImageStore()
    numbers = [
        files.put(BrowserFile('image/jpeg', b'x' * 10, {}))
        for _ in range(question_images.MOST_KEPT + 5)
    ]
    assert files.find(numbers[4]) is None and files.find(numbers[5]) is not None
    monkeypatch.setattr(question_images, 'MOST_BYTES', 100)
    last = files.put(BrowserFile('image/jpeg', b'x' * 60, {}))
    assert files.find(last) and files.find(numbers[-1]) and files.find(numbers[-6]) is None


def test_preconditions_are_kept_by_question_and_robot(monkeypatch):
    board, sections, question = PreconditionStatuses(), PageSections(), listed(monkeypatch)
    checks = [
        PreconditionCheck('PICK', 'free', PreconditionCheck.HOLDS, 'yes', 2.0),
        PreconditionCheck('PICK', 'door', PreconditionCheck.UNKNOWN, '', -1.0),
        PreconditionCheck('PICK', 'odd', PreconditionCheck.HOLDS, '', float('inf')),
    ]
    monkeypatch.setattr(precondition_sections.time, 'time', lambda: 1000.0)
    board.taker('/beta')(PreconditionChecks(query_id='q1', checks=checks))
    board.write_sections(sections, [question])
    assert sections.get('preconditions') == {}
    board.taker('/alpha')(PreconditionChecks(query_id='q1', checks=checks))
    board.write_sections(sections, [question])
    assert sections.get('preconditions') == {
        question.key: {
            'PICK': [
                {'name': 'free', 'holds': True, 'text': 'yes', 'checked': 998.0},
                {'name': 'door', 'holds': None, 'text': '', 'checked': None},
                {'name': 'odd', 'holds': True, 'text': '', 'checked': None},
            ]
        }
    }


def test_an_image_is_as_late_as_its_stamp_says_not_as_it_came(monkeypatch):
    found = seen('/alpha/head/rgb/image_raw')
    board, question = QuestionImages(ImageStore(), found), listed(monkeypatch, stamp_s=9000)
    found.on('/alpha/head/rgb/image_raw').take(picture(stamp_s=9000.0 - 3600.0))
    told = shown(board, question)
    assert [(each['late'], each['stamped']) for each in told] == [(-3600.0, True)], 'a latched one'
    found.on('/alpha/head/rgb/image_raw').take(picture(200, stamp_s=9001.5))
    told = shown(board, question)
    assert [each['late'] for each in told] == [1.5], 'one of the question comes in its place'
    found.on('/alpha/head/rgb/image_raw').take(picture(100, stamp_s=9002.5))
    assert shown(board, question) == told, 'and stays'


def test_an_image_without_a_stamp_says_when_it_came(monkeypatch):
    found = seen('/alpha/head/rgb/image_raw')
    board, question = QuestionImages(ImageStore(), found), listed(monkeypatch)
    found.on('/alpha/head/rgb/image_raw').take(picture())
    assert [(each['late'], each['stamped']) for each in shown(board, question)] == [(0.5, False)]


@pytest.mark.parametrize('before_s, late', [(0.4, None), (7.0, -7.0)])
def test_the_robot_s_own_image_is_of_the_failure_where_its_stamp_says_so(
    monkeypatch, before_s, late
):
    board, question = QuestionImages(ImageStore(), seen()), listed(monkeypatch, stamp_s=9000)
    image = compressed(picture(stamp_s=9000.0 - before_s))
    board.taker('/alpha')(FailureFrames(query_id='q1', topics=['/wrist'], images=[image]))
    assert [(each['late'], each['stamped']) for each in shown(board, question)] == [(late, True)]


def test_a_robot_without_a_camera_of_its_own_gets_no_other_one(monkeypatch):
    found = seen('/beta/head/rgb/image_raw')
    board, question = QuestionImages(ImageStore(), found), listed(monkeypatch)
    found.on('/beta/head/rgb/image_raw').take(picture())
    assert shown(board, question) == []
