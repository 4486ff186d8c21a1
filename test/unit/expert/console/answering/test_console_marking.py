"""What people do through a perception interface: which interface it reaches, and what the page is
told.
"""

import base64
import json

import cv2
import numpy as np
import pytest
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, Vector3
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from smach_oracle.expert.claims import ClaimKeeper
from smach_oracle.expert.console.answering import sensor_discovery
from smach_oracle.expert.console.answering.interface_actions import action_of
from smach_oracle.expert.console.answering.interface_commands import (
    NOT_RUNNING,
    InterfaceCommands,
    marked_view,
    outlines,
)
from smach_oracle.expert.console.answering.question_commands import QuestionCommands
from smach_oracle.expert.console.commands.commands import parse
from smach_oracle.expert.console.web.audit import Person
from smach_oracle.expert.console.web.sections import PageSections
from smach_oracle.expert.followed_server import ListedQuestion
from smach_oracle.msg import ExpertQueryGoal, InterfaceOffer
from smach_oracle.ros.images import cloud_message, mask_image
from smach_oracle.ros.userdata_codec import decode_all
from smach_oracle.srv import (
    FinishInterfaceResponse,
    GiveUpInterfaceResponse,
    SegmentObjectResponse,
    UseFrameRequest,
    UseFrameResponse,
)

ANN = Person('127.0.0.1', 'session', 'operator', 'ann')
MARK = {
    'stamp': '12.000000034',
    'region': [[0, 0], [9, 0], [9, 9]],
    'strokes': [{'foreground': False, 'width': 4, 'points': [[1, 2]]}],
}
RESPONSES = {
    'segment': SegmentObjectResponse(message='too little depth'),
    'use_frame': UseFrameResponse(ok=True),
    'finish': FinishInterfaceResponse(False, 'no object is marked'),
    'give_up': GiveUpInterfaceResponse(True, ''),
}


def listed(running='look', action='perception'):
    goal = ExpertQueryGoal(
        query_id='q',
        robot='/alpha/task',
        interface=running,
        interfaces=[InterfaceOffer('drive', '/drive', ''), InterfaceOffer('look', action, '')],
    )
    return ListedQuestion('/alpha/expert_query', goal, 3, 'ann', 0.0, 1.0)


class Calls(list):
    """The services, which remember."""

    def __call__(self, name, kind, request, limit_s=5.0):
        self.append((name, request))
        return RESPONSES[name.split('/')[-1]]


def carry_out(name, calls, question=None, known=('/alpha/perception',), **info):
    command = parse(json.dumps(dict(info, id=1, do=name, question='q')))
    return InterfaceCommands(lambda action: action in known, calls).carry_out(
        command, ANN, question or listed()
    )


def test_the_action_is_resolved_as_the_robot_does_it():
    assert action_of(listed()) == '/alpha/perception'
    assert action_of(listed(action='/shared/eye')) == '/shared/eye'
    assert action_of(listed(running='')) == '' and action_of(listed(running='other')) == ''


@pytest.mark.parametrize(
    'name, info',
    [
        ('mark', MARK),
        ('use_frame', {'frame': 'fresh'}),
        ('hand_over', {'outcome': 'done'}),
        ('give_up_interface', {}),
    ],
)
@pytest.mark.parametrize(
    'question, known',
    [
        (listed(running=''), ['/alpha/perception']),
        (listed(running='drive'), ['/alpha/perception']),
        (listed(), []),
    ],
)
def test_nothing_is_called_unless_a_perception_interface_runs_for_that_question(
    name, info, question, known
):
    calls = Calls()
    reply = carry_out(name, calls, question, known, **info)
    assert (reply.ok, reply.message, calls) == (False, NOT_RUNNING, [])


def test_a_mark_reaches_the_interface_and_its_refusal_the_page():
    calls = Calls()
    reply = carry_out('mark', calls, **MARK)
    ((name, request),) = calls
    assert name == '/alpha/perception/segment' and (request.stamp.secs, request.stamp.nsecs) == (
        12,
        34,
    )
    assert [(corner.x, corner.y) for corner in request.polygon.points] == [(0, 0), (9, 0), (9, 9)]
    (stroke,) = request.strokes
    assert (stroke.foreground, stroke.width, stroke.points[0].y) == (False, 4, 2)
    assert (reply.ok, reply.message, reply.data['outlines']) == (False, 'too little depth', [])


def test_frames_handing_over_and_giving_up():
    calls = Calls()
    assert carry_out('use_frame', calls, frame='fresh').ok
    assert not carry_out(
        'hand_over', calls, outcome='done', why='seen', outputs=[{'key': 'fits', 'value': [True]}]
    ).ok
    assert carry_out('give_up_interface', calls).ok
    assert [name for name, _ in calls] == [
        '/alpha/perception/' + each for each in ('use_frame', 'finish', 'give_up')
    ]
    assert calls[0][1].frame == UseFrameRequest.FRESH
    assert (calls[1][1].outcome, calls[1][1].text, calls[2][1].text) == (
        'done',
        'ann: seen',
        'by ann',
    )
    assert [calls[1][1].query_id, calls[2][1].query_id] == ['q', 'q'], 'a late one ends no other'
    assert decode_all(calls[1][1].outputs) == {'fits': [True]}


def test_the_page_is_told_of_the_mask_the_place_and_the_size():
    mask = np.zeros((40, 60), bool)
    mask[10:30, 20:40] = True
    turned = Quaternion(0, 0, np.sin(0.25), np.cos(0.25))
    answer = SegmentObjectResponse(
        ok=True,
        mask=mask_image(mask, Header()),
        size=Vector3(0.1, 0.2, float('nan')),
        elapsed=0.05,
        object=PoseStamped(Header(frame_id='base'), Pose(Point(1, 2, 3), turned)),
        cloud=cloud_message(
            np.array([[1.0, 2.0, 3.0], [2.0, 2.0, 3.0]]), Header(), np.full((2, 3), 7, np.uint8)
        ),
    )
    info = marked_view(answer)
    cloud = info['object'].pop('cloud')
    assert (cloud['count'], cloud['offset'], cloud['scale'][0]) == (2, (1, 2, 3), 1)
    assert base64.b64decode(cloud['data'])[12:] == b'\7' * 6
    assert info['object'] == {
        'frame': 'base',
        'position': (1, 2, 3),
        'yaw': 0.5,
        'points': 2,
        'size': (0.1, 0.2, 0.0),
    }
    drawn = np.zeros(mask.shape, np.uint8)
    cv2.drawContours(
        drawn, [np.array(line).reshape(-1, 1, 2) for line in info['outlines']], -1, 1, -1
    )
    assert (drawn.astype(bool) == mask).all()
    json.dumps(info, allow_nan=False)
    answer.cloud = PointCloud2(width=1000000)
    assert marked_view(answer)['object']['cloud']['count'] == 0, (
        'a cloud that contradicts itself is not drawn'
    )


def test_an_outline_keeps_its_holes_and_is_never_long():
    mask = np.zeros((100, 100), np.uint8)
    mask[10:90, 10:90] = 255
    mask[40:60, 40:60] = 0
    assert len(outlines(mask)) == 2
    noise = np.random.default_rng(1).integers(0, 2, (480, 640)).astype(np.uint8)
    assert sum(map(len, outlines(noise))) <= 2 * 6000


class Front:
    """A front end with one question."""

    def find(self, key):
        return listed()

    def questions(self):
        return [listed()]


class Audit(list):
    """Remembers."""

    def record(self, person, name, ok, message, arguments, question):
        self.append((name, ok, question.goal.query_id, 'region' in arguments))


def test_every_such_command_is_audited_with_its_question(monkeypatch):
    monkeypatch.setattr(ClaimKeeper, '_run', lambda self: None)
    audit, calls = Audit(), Calls()
    question_commands = QuestionCommands(
        Front(), audit, InterfaceCommands(lambda action: True, calls).commands
    )
    question_commands.carry_out(
        parse(json.dumps(dict(MARK, id=1, do='mark', question='q'))), ANN, 1
    )
    assert audit == [('mark', False, 'q', True)] and len(calls) == 1


def test_an_interface_is_found_by_the_types_beside_its_action(monkeypatch):
    types = {
        '/alpha/perception/segment': 'smach_oracle/SegmentObject',
        '/alpha/fake/segment': 'std_srvs/Empty',
    }
    monkeypatch.setattr(sensor_discovery.rosservice, 'get_service_type', types.get)
    sections = PageSections()
    watching = sensor_discovery.SensorDiscovery(sections, Front())
    published = [
        [name + '/result', 'smach_oracle/SharedAutonomyActionResult']
        for name in ('/alpha/perception', '/alpha/fake', '/alpha/drive')
    ]
    published += [
        ['/alpha/perception/image', 'sensor_msgs/Image'],
        ['/other/result', 'std_msgs/String'],
        ['/other/cloud', 'sensor_msgs/PointCloud2'],
    ]
    watching._follow_interfaces(published, set(types) | {'/other/segment'})
    watching.sensors.follow(published)
    watching.write_sections()
    image = watching.sensors.on('/alpha/perception/image').number
    assert sections.get('sensors')['perception'] == {
        '/alpha/expert_query q': {'image': image, 'cloud': None}
    }
    watching._follow_interfaces(published, {'/alpha/fake/segment'})
    watching.write_sections()
    assert sections.get('sensors')['perception'] == {}
