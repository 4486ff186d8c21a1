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
from smach_oracle.scripted_operator import manual_task
from smach_oracle.scripted_operator.image_viewer import ViewError
from smach_oracle.scripted_operator.ladder import BY_HAND, CLEAR, MARK, NextAct
from smach_oracle.scripted_operator.manual_task import ManualTask, carry_out, point_in_base
from smach_oracle.scripted_operator.node import ScriptedOperator, grippers_of
from smach_oracle.scripted_operator.seen_scene import SeenScene, SeenThing
from smach_oracle.scripted_operator.state_plans import StatePlan, StatePlans
from smach_oracle.scripted_operator.topic_hand import GoalEndedError

QUESTION = SimpleNamespace(key='r/q1', status=OpenQuery.PENDING, goal=SimpleNamespace(
    failed_state='PICK', container_path='SM', robot='r', trial_id='t', failure_kind=1))


CAN = SeenThing('can', True, True, (300, 200, 40, 60), np.ones((4, 4), bool),
                UprightBox(np.array([0.6, 0.0, 0.78]), np.array([0.06, 0.06, 0.12]), 0.0))
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


MEANS = SimpleNamespace(means=SimpleNamespace(forget=lambda: None))


@pytest.mark.parametrize('blind, looks, claims', [(0, 1, 1), (2, 3, 1), (9, 3, 0)])
def test_a_question_is_tried_again_while_no_image_comes_but_not_for_ever(
        blind, looks, claims):
    questions, eye = Questions(10), BlindViewer(blind)
    with pytest.raises(KeyboardInterrupt):
        ScriptedOperator(SimpleNamespace(seed=1), questions, eye, MEANS).run()
    assert (eye.looks, questions.claims) == (looks, claims)


def test_a_state_that_still_runs_is_left_alone():
    questions, eye = Questions(10, ExpertQueryGoal.STILL_RUNNING), BlindViewer(0)
    with pytest.raises(KeyboardInterrupt):
        ScriptedOperator(SimpleNamespace(seed=1), questions, eye, MEANS).run()
    assert (eye.looks, questions.claims) == (0, 0)


@pytest.mark.parametrize('offered, told', [([
    'eye', 'hand'
], "PICK: means take needs an interface offered under the name 'manipulation'; offered: eye, hand"),
                                           ([], "'manipulation'; offered: none"),
                                           (['manipulation'], ''),
                                           (['perception', 'manipulation'], '')])
def test_where_an_interface_has_another_name_it_says_so_once_and_tries_without(
        monkeypatch, offered, told):
    warned = []
    monkeypatch.setattr(rospy, 'logwarn', lambda text, *what: warned.append(text % what))
    settings = SimpleNamespace(plans=StatePlans({'PICK': {'means': 'take'}}), most_questions=9)
    seen = SimpleNamespace(gap=lambda arm: 0.0, look_at=lambda point: SCENE)
    operator = ScriptedOperator(settings, None, None, SimpleNamespace(means=seen))
    goal = SimpleNamespace(failed_state='PICK', choices=[SimpleNamespace(
        state='PICK', blocked='', container='')],
                           interfaces=[SimpleNamespace(name=name) for name in offered])
    answers = [
        operator._decide(SimpleNamespace(goal=goal), {}, SCENE)[0] for _ in range(2)
    ]
    assert all(bool(answer.interface) != bool(told) for answer in answers)
    assert len(warned) == bool(told) and told in ''.join(warned)


def task(act):
    return ManualTask('q1', NextAct(act), StatePlan('show'), {}, 0, np.random.default_rng(1),
                      np.array([0.6, 0.0, 0.78]))


class Settled:
    """How the goal of an interface was ended."""

    def __init__(self):
        self.gave_up = []

    def give_up(self, text):
        self.gave_up.append(text)


@pytest.mark.parametrize('fault',
                         [GoalEndedError('no image within 20 s'),
                          rospy.ServiceException('gone')])
def test_an_interface_that_fails_under_the_hands_is_given_up_so_that_the_question_is_asked_again(
        fault):
    def take_image(_limit_s):
        raise fault
    settled = Settled()
    interfaces = SimpleNamespace(perception=SimpleNamespace(take_image=take_image),
                                 perception_finish=settled, hand_finish=None)
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
    ended = []
    finish = SimpleNamespace(finish=lambda *_: ended.append('finished') or '',
                             give_up=lambda text: ended.append(text))
    result = carry_out(task(act), SimpleNamespace(hand_finish=finish, perception_finish=None))
    assert (result.superseded, result.worked) == (superseded, True)
    assert len(ended) == 1 and ('finished' in ended) == superseded


@pytest.mark.parametrize('value', [[], {'right': 'joint'}, {'right': [3]}])
def test_gripper_joints_that_cannot_be_are_refused(value):
    with pytest.raises(SettingsError, match='~grippers'):
        grippers_of(value)
