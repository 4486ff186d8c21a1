"""The scripted operator when others fail it: a world or an interface that does not answer must not
end the trial.
"""

from types import SimpleNamespace

import numpy as np
import pytest
import rospy
from geometry_msgs.msg import Point, PoseStamped

from smach_oracle.geometry.box import UprightBox
from smach_oracle.msg import ExpertQueryGoal, OpenQuery
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.scripted_operator import manual_task, robot_means
from smach_oracle.scripted_operator.image_viewer import ViewError
from smach_oracle.scripted_operator.ladder import BY_HAND, CLEAR, MARK, NextAct, Sight
from smach_oracle.scripted_operator.manual_task import ManualTask, carry_out, point_in_base
from smach_oracle.scripted_operator.node import ScriptedOperator, grippers_of
from smach_oracle.scripted_operator.robot_means import MeansNames
from smach_oracle.scripted_operator.seen_scene import SeenScene, SeenThing
from smach_oracle.scripted_operator.state_plans import StatePlan, StatePlans
from smach_oracle.scripted_operator.topic_hand import GoalEndedError

QUESTION = SimpleNamespace(
    key='r/q1',
    status=OpenQuery.PENDING,
    goal=SimpleNamespace(
        failed_state='PICK', container_path='SM', robot='r', trial_id='t', failure_kind=1
    ),
)


CAN = SeenThing(
    'can',
    True,
    True,
    (300, 200, 40, 60),
    np.ones((4, 4), bool),
    UprightBox(np.array([0.6, 0.0, 0.78]), np.array([0.06, 0.06, 0.12]), 0.0),
)
SCENE = SeenScene([CAN], None)


class Questions:
    """A front end with one question that stays open, for so many looks at the list."""

    def __init__(self, rounds, failure_kind=1):
        self._rounds = rounds
        QUESTION.goal.failure_kind = failure_kind
        self.claims = 0

    def wait_for_change(self, version, _timeout_s):
        self._rounds -= 1
        if self._rounds < 0:
            raise KeyboardInterrupt
        return version

    def questions(self):
        return [QUESTION]

    def release(self, _listed):
        pass

    def claim(self, _listed):
        self.claims += 1
        return SimpleNamespace(ok=False)


class BlindViewer:
    """Blind at first."""

    chance = 7

    def __init__(self, blind):
        self.looks = 0
        self._blind = blind

    def look(self):
        self.looks += 1
        if self.looks <= self._blind:
            raise ViewError('no image comes')
        return SeenScene([], None)


class IdleMeans:
    """Means of which nothing but the charge of time is wanted."""

    def __init__(self):
        self.charged = []

    def forget(self):
        pass

    def begin_work(self):
        self.charged.append('begins')

    def end_work(self):
        self.charged.append('ends')


MEANS = SimpleNamespace(means=IdleMeans())


@pytest.mark.parametrize('blind, looks, claims', [(0, 1, 1), (2, 3, 1), (9, 3, 0)])
def test_a_question_is_tried_again_while_no_image_comes_but_not_for_ever(blind, looks, claims):
    questions, eye = Questions(10), BlindViewer(blind)
    with pytest.raises(KeyboardInterrupt):
        ScriptedOperator(SimpleNamespace(seed=1), questions, eye, MEANS).run()
    assert (eye.looks, questions.claims) == (looks, claims)


class Answered(Questions):
    """A front end whose question is claimed and answered."""

    def __init__(self, course):
        super().__init__(2)
        self._course = course

    def claim(self, _listed):
        self._course.append('claimed')
        return SimpleNamespace(ok=True)

    def answer(self, _listed, decision):
        self._course.append(decision.state)
        return SimpleNamespace(ok=True)


def test_all_time_from_when_a_question_is_taken_up_to_when_the_machine_goes_on_is_charged(
    monkeypatch,
):
    means = IdleMeans()
    means.pass_time = lambda seconds: means.charged.append('thinks')
    questions = Answered(means.charged)
    settings = SimpleNamespace(seed=1, median_s=15.0, sigma=0.5)
    operator = ScriptedOperator(settings, questions, BlindViewer(0), SimpleNamespace(means=means))
    monkeypatch.setattr(
        operator,
        '_decide',
        lambda *_: (NextAct('back', goto='DETECT'), SimpleNamespace(sight=Sight())),
    )
    QUESTION.goal.userdata, QUESTION.goal.text = [], 'it slipped'
    with pytest.raises(KeyboardInterrupt):
        operator.run()
    assert means.charged[:5] == ['begins', 'claimed', 'thinks', 'thinks', 'ends']
    assert means.charged[5] == 'DETECT', 'the machine goes on only then'


def test_the_time_is_charged_once_and_not_where_nobody_counts_it(monkeypatch):
    asked = []
    monkeypatch.setattr(
        robot_means, 'call_service', lambda name, kind, request, limit_s: asked.append(request.on)
    )
    monkeypatch.setattr(robot_means, 'GoalLink', lambda *_: None)
    monkeypatch.setattr(rospy, 'Subscriber', lambda *_, **__: None)
    for names, charged in (
        (MeansNames(), [True, False]),
        (MeansNames(pass_time='none'), []),
        (MeansNames(charge_time='none'), []),
    ):
        asked.clear()
        means = robot_means.RobotMeans(names, {}, None)
        for work in (means.begin_work, means.begin_work, means.end_work, means.end_work):
            work()
        assert asked == charged


def test_a_state_that_still_runs_is_left_alone():
    questions, eye = Questions(10, ExpertQueryGoal.STILL_RUNNING), BlindViewer(0)
    with pytest.raises(KeyboardInterrupt):
        ScriptedOperator(SimpleNamespace(seed=1), questions, eye, MEANS).run()
    assert (eye.looks, questions.claims) == (0, 0)


@pytest.mark.parametrize(
    'offered, told',
    [
        (
            ['eye', 'hand'],
            "PICK: means take needs an interface offered under the name 'manipulation'; "
            'offered: eye, hand',
        ),
        ([], "'manipulation'; offered: none"),
        (['manipulation'], ''),
        (['perception', 'manipulation'], ''),
    ],
)
def test_where_an_interface_has_another_name_it_says_so_once_and_tries_without(
    monkeypatch, offered, told
):
    warned = []
    monkeypatch.setattr(rospy, 'logwarn', lambda text, *what: warned.append(text % what))
    settings = SimpleNamespace(plans=StatePlans({'PICK': {'means': 'take'}}), most_questions=9)
    image = SimpleNamespace(colour=np.full((4, 4, 3), 128), depth=np.ones((4, 4)))
    seen = SimpleNamespace(
        gap=lambda arm: 0.0,
        tall=lambda name: None,
        look_at=lambda point: SCENE._replace(image=image),
    )
    operator = ScriptedOperator(settings, None, None, SimpleNamespace(means=seen))
    goal = SimpleNamespace(
        failed_state='PICK',
        recoveries=0,
        choices=[SimpleNamespace(state='PICK', blocked='', container='')],
        interfaces=[SimpleNamespace(name=name) for name in offered],
    )
    answers = [operator._decide(SimpleNamespace(goal=goal), {}, SCENE)[0] for _ in range(2)]
    assert all(bool(answer.interface) != bool(told) for answer in answers)
    assert len(warned) == bool(told) and told in ''.join(warned)


def task(act):
    return ManualTask(
        'q1',
        NextAct(act),
        StatePlan('show'),
        {},
        0,
        np.random.default_rng(1),
        np.array([0.6, 0.0, 0.78]),
    )


class Settled:
    """How the goal of an interface was ended."""

    def __init__(self):
        self.gave_up = []

    def give_up(self, text):
        self.gave_up.append(text)


@pytest.mark.parametrize(
    'fault', [GoalEndedError('no image within 20 s'), rospy.ServiceException('gone')]
)
def test_an_interface_that_fails_under_the_hands_is_given_up_so_that_the_question_is_asked_again(
    fault,
):
    def take_image(_limit_s):
        raise fault

    settled = Settled()
    interfaces = SimpleNamespace(
        perception=SimpleNamespace(take_image=take_image),
        perception_finish=settled,
        hand_finish=None,
        means=IdleMeans(),
    )
    assert carry_out(task(MARK), interfaces) == (False, False, str(fault))
    assert settled.gave_up == [str(fault)]


def test_places_are_read_from_poses_in_frames_that_are_known():
    pose = PoseStamped()
    pose.pose.position = Point(0.6, 0.1, 0.7)
    assert point_in_base(pose) is None and point_in_base('here') is None
    pose.header.frame_id = 'base_link'
    assert point_in_base(pose) == pytest.approx([0.6, 0.1, 0.751]), 'whatever its orientation'


@pytest.mark.parametrize('act, superseded', [(BY_HAND, True), (CLEAR, False)])
def test_only_the_work_of_the_state_supersedes_it(monkeypatch, act, superseded):
    """Room that was made is no pick: the question is asked again."""
    monkeypatch.setattr(manual_task, '_driven', lambda *_: '')
    means = IdleMeans()
    ended = means.charged = []
    finish = SimpleNamespace(
        finish=lambda *_: ended.append('finished') or '', give_up=lambda text: ended.append(text)
    )
    result = carry_out(
        task(act), SimpleNamespace(hand_finish=finish, perception_finish=None, means=means)
    )
    assert ended[0] == 'ends', 'before the machine goes on'
    ended[:] = [each for each in ended if each != 'ends']
    assert (result.superseded, result.worked) == (superseded, True)
    assert len(ended) == 1 and ('finished' in ended) == superseded


@pytest.mark.parametrize('value', [[], {'right': 'joint'}, {'right': [3]}])
def test_gripper_joints_that_cannot_be_are_refused(value):
    with pytest.raises(SettingsError, match='~grippers'):
        grippers_of(value)
