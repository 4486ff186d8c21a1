"""Every shape of JSON that the console's server sends, made by the server's own code."""

import json
import math
import tempfile
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from expert_fixtures import make_question
from fake_trials import play
from geometry_msgs.msg import PointStamped, Vector3
from sensor_msgs.msg import BatteryState, CompressedImage, JointState
from std_msgs.msg import Header

from smach_oracle.analysis.graphs.container_graph import (
    ContainerGraph,
    GraphEdge,
    GraphLayout,
    drawing,
)
from smach_oracle.expert.console.answering import teleoperation
from smach_oracle.expert.console.answering.driving_control import DrivingControl, DrivingSession
from smach_oracle.expert.console.answering.interface_commands import marked_view
from smach_oracle.expert.console.answering.interface_output_view import interface_output_view
from smach_oracle.expert.console.answering.last_heard import LastHeard
from smach_oracle.expert.console.answering.onlookers import Onlookers
from smach_oracle.expert.console.answering.precondition_sections import status_view
from smach_oracle.expert.console.answering.question_view import question_view
from smach_oracle.expert.console.answering.sensor_discovery import SensorDiscovery
from smach_oracle.expert.console.feeds.views import event_of, event_view
from smach_oracle.expert.console.people.answer_times import AnsweredQuestion
from smach_oracle.expert.console.people.people import People
from smach_oracle.expert.console.people.shift_journal import ShiftJournal
from smach_oracle.expert.console.reach.on_call import (
    CallStep,
    OnCallList,
    OnCallPerson,
    Receiver,
)
from smach_oracle.expert.console.reach.outbox import CallResult
from smach_oracle.expert.console.reach.quiet_hours import QuietHours
from smach_oracle.expert.console.reach.reach import Reach
from smach_oracle.expert.console.reach.secret_file import Secret
from smach_oracle.expert.console.robots.down_machines import DownMachines
from smach_oracle.expert.console.robots.followed_robot import FollowedRobot
from smach_oracle.expert.console.robots.robot_health import RobotHealth
from smach_oracle.expert.console.sensors import sample_handlers
from smach_oracle.expert.console.sensors.question_images import QuestionImage, image_view
from smach_oracle.expert.console.sensors.question_replays import kept_replay
from smach_oracle.expert.console.sensors.robot_appearance import RobotAppearance
from smach_oracle.expert.console.sensors.robot_cameras import RobotCameras
from smach_oracle.expert.console.sensors.sensor_streams import SensorStream, SensorStreams
from smach_oracle.expert.console.trials.bag_catalogue import BagCatalogue
from smach_oracle.expert.console.trials.recovery_statistics import RecoveryCounts
from smach_oracle.expert.console.trials.ways import Level
from smach_oracle.expert.console.web.audit import Person
from smach_oracle.expert.console.web.shifts import Shifts
from smach_oracle.expert.followed_server import ListedQuestion, ListNews
from smach_oracle.expert.interface_outputs import InterfaceOutputs
from smach_oracle.msg import (
    ActiveState,
    ConsoleCommand,
    ControlStatus,
    FailureReplay,
    InterfaceOutput,
    MachineControl,
    OpenQuery,
    OracleEvent,
    OracleRates,
    PreconditionCheck,
    PreconditionChecks,
    StateRate,
    TeleopState,
    TransitionCount,
)
from smach_oracle.oracle.asking.question import StateChoice
from smach_oracle.oracle.records.events import EventKind, FailureKind
from smach_oracle.oracle.records.visits import Visit, VisitResult
from smach_oracle.oracle.settings.failure_rule import FailureRule
from smach_oracle.ros.expert.question_messages import to_goal
from smach_oracle.ros.images import cloud_message, colour_image, depth_image, mask_image
from smach_oracle.ros.recorder import TrialRecorder
from smach_oracle.srv import SegmentObjectResponse
from smach_oracle.store.codecs import Codecs
from smach_oracle.store.rows import Fact, NewMoment
from smach_oracle.store.store_file import NewTrial, StoreFile

KEY = '/robot/expert_query q1'
URDF = """<robot name="arm">
<link name="base"><visual><geometry><box size="1 2 4"/></geometry></visual></link>
<link name="hand"><visual><geometry><mesh filename="none"/></geometry></visual></link>
<joint name="j" type="fixed"><parent link="base"/><child link="hand"/></joint></robot>"""


def listed(status=OpenQuery.PENDING, deadline_s=math.inf, interface='', **changes):
    goal = to_goal(make_question(**changes), '/robot', rospy.Time(1))
    goal.interface = interface
    return ListedQuestion('/robot/expert_query', goal, status, 'ann', 10.0, deadline_s)


def questions():
    """With every kind of value that a question may hold."""
    visits = tuple(Visit('PICK', 'done', result) for result in VisitResult)
    unknown = (StateChoice('PICK', math.nan, 0, 0, (), ()),)
    userdata = {
        'plain': {'a': 1},
        'message': PointStamped(),
        'messages': [PointStamped()],
        'unsent': object(),
    }
    asked = [
        listed(),
        listed(OpenQuery.CLAIMED, 20.0, userdata=userdata, history=visits),
        listed(OpenQuery.INTERFACE_RUNNING, interface='assist', rate=math.nan, choices=unknown),
        listed(failure_kind=FailureKind.STILL_RUNNING, outcome='', interfaces=()),
    ]
    return [
        dict(
            question_view(
                each, 1000.0, lambda target: RecoveryCounts(1, 2), FailureRule(), levels(visits)
            ),
            session='a1',
            idle=0,
        )
        for each in asked
    ]


def levels(visits):
    return [Level('TASK', 'FETCH', visits, missing) for missing in ('', 'unheard', 'older')]


class NoLayouter:
    """As where Graphviz is absent."""

    def find(self, text, done):
        return None


class FrontEnd:
    """With one question, for which an interface runs."""

    def questions(self):
        return [listed(OpenQuery.INTERFACE_RUNNING, interface='assist')]


def put_questions(sections):
    sections.put('questions', questions())
    put_people(sections)
    put_reach(sections)
    sections.put('servers', [{'name': '/robot/expert_query', 'connected': True}])
    checks = [
        PreconditionCheck(state='PICK', age=age, result=result)
        for age, result in ((1.0, PreconditionCheck.HOLDS), (-1.0, PreconditionCheck.UNKNOWN))
    ]
    sections.put('preconditions', {KEY: status_view(PreconditionChecks(checks=checks), 1000.0)})
    RobotCameras(SensorStreams(), {}).write_sections(sections, ['/robot'])
    sections.put(
        'images',
        {KEY: [image_view(QuestionImage(1, '/camera', late_s, 4, 4)) for late_s in (None, 1.5)]},
    )
    sections.put('replays', {KEY: 1})


def replay():
    """A replay with an image, an event and a joint."""
    now = rospy.Time(100)
    event = OracleEvent(kind=OracleEvent.FAILURE, header=Header(stamp=now), state='PICK')
    joints = JointState(name=['elbow'], position=[0.5])
    return kept_replay(
        FailureReplay(
            header=Header(stamp=now),
            seconds=30.0,
            topics=['/camera'],
            cameras=b'\0',
            images_came=[now],
            images=[CompressedImage()],
            joints_came=[now],
            joints=[joints],
            events=[event],
        )
    ).view


def put_reach(sections):
    """A person was called about a question, and another one was not reached."""
    people = {
        name: OnCallPerson((Receiver(name, 'slack', Secret('x')),), QuietHours('quiet', ()))
        for name in ('ann', 'bob')
    }
    on_call = OnCallList(people, (CallStep(0.0, ('ann',)), CallStep(1e9, ('bob',))), pictures=False)
    sent = SimpleNamespace(add=lambda question: None)
    open_now = [listed()]
    reach = Reach(
        on_call,
        'https://robots.example.org',
        sections,
        lambda: open_now,
        lambda each: True,
        lambda key: None,
        lambda *arguments: sent,
    )
    for status in ('sent', 'failed'):
        reach._note(CallResult(KEY, people['ann'].receivers[0], status, 'no', 1.0))
    reach.look()
    shown = sections.get('reach')
    assert shown['calls'] and shown['next'] and shown['failed']


def put_people(sections):
    """Who looks at a question, and who is heard: one server is, the other one and the master never
    were.
    """
    Onlookers(sections).look(1, KEY, Person('', 'a1', 'operator', 'ann'))
    front = SimpleNamespace(
        servers=['/a', '/b'],
        questions=lambda: [listed()],
        news=lambda name: ListNews(1.0, 2.0) if name == '/a' else None,
    )
    LastHeard(
        front,
        SimpleNamespace(follow=lambda nodes: None, heard_s=lambda node: 1.0),
        lambda: {'/robot': ['/node']},
        lambda: None,
    ).write_sections(sections)


def put_notes(sections):
    """Notes and times of people, and what they did."""
    journal = ShiftJournal()
    journal.write_note('ann', 'The gripper is worn.')
    for times in ((1.0, 2.0, 3.0), (None, 2.0, None)):
        journal.add_answered(AnsweredQuestion(1e9, 'ann', *times))
    people = People(journal, Shifts(), None)
    people.acts.take(ConsoleCommand(command='answer', expert='ann', arguments='{"kind": "goto"}'))
    people.write_sections(sections)


def put_down(sections):
    """A machine whose program has stopped, in the middle of a question."""
    with tempfile.TemporaryDirectory() as folder:
        path = folder + '/robot.db'
        store = StoreFile(path)
        number = store.begin_trial(NewTrial('TASK', 't', ('id', '{}'), 5.0))
        store.add(
            number,
            [
                NewMoment(
                    6.0,
                    0,
                    'QUERY_OPENED',
                    'TASK',
                    'A',
                    tuple(
                        Fact('TASK', name, Codecs().encode(value))
                        for name, value in (
                            ('at', ['A', 'in']),
                            ('asked', ['A', 't-1']),
                            ('key:cup', 'red'),
                        )
                    ),
                )
            ],
        )
        store.close()
        DownMachines([path, folder + '/none.db'], sections).look()


def put_health(sections):
    """One robot with a battery and a part that has failed, one with neither."""
    health = RobotHealth()
    health.on_battery('/alpha/battery', BatteryState(percentage=0.5, voltage=math.nan))
    health.on_diagnostics(
        '/diagnostics', DiagnosticArray(status=[DiagnosticStatus(level=2, name='alpha: motor')])
    )
    health.write_sections(sections, ['/alpha', '/beta'])
    assert sections.get('health')['/alpha']['problems']


def put_machines(sections):
    """A robot that is only heard, without a layout, and one container with it."""
    alpha = FollowedRobot('/alpha')
    alpha.on_rates(
        OracleRates(
            states=[
                StateRate('TASK', 'A', 0.25, 1, 3, 1, 0, False),
                StateRate('TASK', 'B', math.nan, 0, 0, 0, 0, True),
            ],
            transitions=[TransitionCount('TASK', 'A', 'ok', 'B', 3)],
        )
    )
    alpha.on_event(OracleEvent(kind=OracleEvent.TRANSITION, path='TASK', state='A', target='B'))
    alpha.on_event(OracleEvent(kind=OracleEvent.FAILURE, path='TASK', state='B', rate=math.nan))
    alpha.on_control(
        ControlStatus(
            machines=[
                MachineControl(
                    'TASK',
                    True,
                    True,
                    'breakpoint A',
                    [ActiveState('TASK', 'A', 'breakpoint', True)],
                    ['A'],
                    [],
                    [],
                    [],
                    [],
                )
            ]
        )
    )
    alpha.write_sections(sections, NoLayouter())
    put_down(sections)
    put_health(sections)
    structure = ContainerGraph('TASK', ('A',), ('done',), (GraphEdge('A', 'ok', 'done'),), 'ORACLE')
    place = (1.0, 2.0, 3.0, 4.0)
    curve = ([(1.0, 2.0), (3.0, 4.0)], (5.0, 6.0))
    layout = GraphLayout(9.0, 8.0, {'n0': place, 'n1': place}, {'e0': curve})
    sections.put('graph /beta TASK', drawing(structure, layout, ['A']))
    sections.put('robots', ['/alpha', '/beta'])


def put_sensors(sections):
    watching = SensorDiscovery(sections, FrontEnd())
    watching._perception_actions = {'/assist'}
    watching.sensors.follow(
        [
            ['/assist/image', 'sensor_msgs/Image'],
            ['/points', 'sensor_msgs/PointCloud2'],
            ['/joint_states', 'sensor_msgs/JointState'],
        ]
    )
    watching.write_sections()
    assert sections.get('sensors')['perception']


def put_interfaces(sections):
    outputs = InterfaceOutputs()
    outputs.taker('/robot')(
        InterfaceOutput(query_id='q1', status=InterfaceOutput.RUNNING, lines=['ready'])
    )
    sections.put('interface_output', {KEY: interface_output_view(outputs.newest('q1'))})
    held = DrivingControl()
    held.take(DrivingSession(KEY, 7, Person('', '', 'teleoperator', 'ann'), None, 0.0), 0.0)
    stands = TeleopState(arm='left', speed=math.nan, clearance=math.inf, gripper=math.nan)
    views = {}
    for state, control, boxes in (
        (None, DrivingControl(), None),
        (TeleopState(), held, 3),
        (stands, held, 0),
    ):
        hand = SimpleNamespace(
            state=state,
            control=control,
            arm='left',
            arms=['left'],
            boxes=boxes,
            frames=lambda arm: {'tool': 'tool', 'base': 'base', 'camera': 'camera'},
        )
        views['{}{}'.format(KEY, len(views))] = teleoperation._view(hand)
    sections.put('manipulation', views)


def put_trials(sections, log, folder):
    """One that was heard, with each kind of event, and two of bags: their shelf."""
    for kind in EventKind:
        log.add(
            '/robot',
            event_of(
                OracleEvent(kind=int(kind), trial_id='t', seq=int(kind), path='TASK', rate=0.5)
            ),
        )
    sections.put('trials', log.overview())
    recorder = TrialRecorder(folder, warn=pytest.fail)
    play(recorder, 2)
    assert recorder.close(30.0)
    Path(folder, 'torn.bag').write_bytes(b'#ROSBAG V2.0\n')
    catalogue = BagCatalogue([folder], sections)
    catalogue.scan()
    return catalogue


def later_event():
    """Of a kind that only a later release knows."""
    return event_view(event_of(OracleEvent(kind=99, rate=math.inf)))


def sensor_facts():
    """What is told beside the newest message of each kind of sensor, by the shape's name."""
    header = Header(frame_id='camera', stamp=rospy.Time(7))
    joints = JointState(name=['a', 'b'], position=[1.0, math.nan])
    found = []
    for name, kind, message in (
        ('ImageFacts', 'Image', colour_image(np.zeros((4, 4, 3), np.uint8), header)),
        ('ImageFacts', 'Image', depth_image(np.ones((4, 4), np.float32), header)),
        ('JointFacts', 'JointState', joints),
        ('CloudFacts', 'PointCloud2', cloud_message(np.ones((5, 3)), header)),
    ):
        sensor = SensorStream(1, '/topic', 'sensor_msgs/' + kind)
        sensor.take(message)
        frame = sensor.newer(0)
        encoded, facts = sensor.file_of(frame, 640)
        found.append((name, json.loads(facts or encoded.body)))
        for age_s in (1.5, None):
            ages = SimpleNamespace(age_s=lambda *_, told=age_s: told)
            found.append(
                (
                    name,
                    json.loads(
                        sample_handlers._with_age(
                            facts or encoded.body.decode(), ages, '/topic', frame
                        )
                    ),
                )
            )
    for place in (np.eye(4)[:3], None):
        beside = SimpleNamespace(
            newer=lambda than: None, place_of=lambda *_, at=place: (at, 'no transform')
        )
        found.append(('CloudFacts', json.loads(sample_handlers._with_place(facts, beside, frame))))
    return found


def model_header():
    body = RobotAppearance(URDF).encoded().body
    return json.loads(body[4 : 4 + int.from_bytes(body[:4], 'little')])


def marked():
    """What a perception interface answers: with an object, and without."""
    answer = SegmentObjectResponse(
        ok=True,
        mask=mask_image(np.ones((4, 4), bool), Header()),
        size=Vector3(1, 2, 3),
        cloud=cloud_message(np.ones((5, 3)), Header()),
    )
    found = marked_view(answer)
    answer.ok = False
    return [found, marked_view(answer)]
