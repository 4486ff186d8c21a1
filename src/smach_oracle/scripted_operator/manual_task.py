"""The operator's work once an interface runs: show a thing or drive the hand, end the goal."""
from typing import Any, Callable, Mapping, NamedTuple, Optional, Tuple

import numpy as np
import rospy
from geometry_msgs.msg import PoseStamped

from .ground_truth import GroundTruth, GroundTruthError
from .hand_driver import HandDriver, StuckError
from .interface_clients import FinishClient, PerceptionClient, until
from .manoeuvres import Attempt, ManoeuvreError, pick, pull_out, put_down
from .showing import show, what_to_show
from .state_plans import PUT_DOWN, SHOW, StatePlan
from .topic_hand import GoalEndedError, TeleoperationClient, TopicHand
from .true_scene import TrueBody, TrueScene

SUCCESS = 'succeeded'
BASE = 'base_footprint'
BASE_LINK_HEIGHT = 0.051  # m of base_link above base_footprint
_BEGIN_S = 30.0  # wall time in which an interface must begin
_MISJUDGED = 0.004  # m, sigma of the places to which the operator drives
_SAME = 0.10  # m within which a thing is the one that was detected


class OperatorInterfaces(NamedTuple):
    """Everything the operator works with."""

    hand: TeleoperationClient
    hand_finish: FinishClient
    perception: PerceptionClient
    perception_finish: FinishClient
    image: Tuple[int, int]  # width and height of the camera's image, px
    period: float  # s, of the manipulation interface


class ManualTask(NamedTuple):
    """One failed state to be done by hand."""

    query_id: str
    plan: StatePlan
    userdata: Mapping[str, Any]
    number: int  # of tries before
    generator: np.random.Generator


def carry_out(task: ManualTask, interfaces: OperatorInterfaces, world: GroundTruth) -> str:
    """Do the work, and end the interface's goal, whatever happens.

    :returns: '' where the state was superseded, else why not.
    """
    shows = task.plan.means == SHOW
    client = interfaces.perception_finish if shows else interfaces.hand_finish
    try:
        wrong = (_shown if shows else _driven)(task, interfaces, world)
        if not wrong:
            wrong = client.finish(SUCCESS, 'by the scripted operator')
    except (GoalEndedError, rospy.ServiceException) as err:
        wrong = str(err)
    if wrong:
        client.give_up(wrong)
    return wrong


def _shown(task: ManualTask, interfaces: OperatorInterfaces, world: GroundTruth) -> str:
    interfaces.perception.take_image(_BEGIN_S)
    try:
        thing = what_to_show(world.read_scene())
    except GroundTruthError as err:
        return str(err)
    if thing is None:
        return 'nothing of it can be seen'
    return show(interfaces.perception.segment, thing, interfaces.image, task.generator,
                lambda: interfaces.perception.take_image(_BEGIN_S))


def _driven(task: ManualTask, interfaces: OperatorInterfaces, world: GroundTruth) -> str:
    if not interfaces.hand.wait_for_goal(task.query_id, _BEGIN_S):
        raise GoalEndedError('the manipulation interface did not begin')
    try:
        hand = TopicHand(interfaces.hand, task.plan.arm, BASE, interfaces.period)
        attempt = Attempt(HandDriver(hand), world.read_scene, task.number,
                          lambda: task.generator.normal(0.0, _MISJUDGED, 3))
        _MANOEUVRES[task.plan.means](task, attempt)
    except (ManoeuvreError, StuckError, GroundTruthError) as err:
        return str(err)
    finally:
        interfaces.hand.let_go(task.plan.arm)
    return ''


def _take(task: ManualTask, attempt: Attempt) -> None:
    if task.plan.inside:
        pull_out(attempt, lambda scene: target_of(task, scene))
    else:
        pick(attempt, lambda scene: target_of(task, scene))


def _put_down(task: ManualTask, attempt: Attempt) -> None:
    scene = attempt.read_scene()
    thing = scene.held_by(task.plan.arm)
    if thing is None:
        raise ManoeuvreError('the hand holds nothing')
    if task.plan.onto:
        if task.plan.onto not in scene.bodies:
            raise ManoeuvreError('there is no {} to put it on'.format(task.plan.onto))
        below = scene.bodies[task.plan.onto]
        put_down(attempt,
                 np.array([below.centre[0], below.centre[1], below.top + thing.size[2] / 2]))
        return
    place = point_in_base(task.userdata.get(task.plan.place))
    if place is None:
        raise ManoeuvreError('userdata {} does not say where'.format(task.plan.place))
    put_down(attempt, place)


_MANOEUVRES: Mapping[str, Callable[[ManualTask, Attempt],
                                   None]] = {'take': _take, PUT_DOWN: _put_down}


def target_of(task: ManualTask, scene: TrueScene) -> Optional[TrueBody]:
    """The thing to take: the trial's own, or the one at the detected pose, or the nearest."""
    if scene.goal_body:
        return scene.bodies.get(scene.goal_body)
    detected = task.userdata.get(task.plan.what)
    point = point_in_base(detected[0] if isinstance(detected, list) and detected else detected)
    named = scene.nearest(point, _SAME) if point is not None else None
    return named or scene.nearest(np.zeros(3), np.inf)


def point_in_base(pose: object) -> Optional[np.ndarray]:
    """(3,) m in base_footprint, of a PoseStamped in that frame or base_link; else None."""
    heights = {BASE: 0.0, 'base_link': BASE_LINK_HEIGHT}
    if not isinstance(pose, PoseStamped) or pose.header.frame_id not in heights:
        return None
    at = pose.pose.position
    return np.array([at.x, at.y, at.z + heights[pose.header.frame_id]])


def connect(perception: str, manipulation: str, operator: str, image: Tuple[int, int],
            rate_hz: float) -> OperatorInterfaces:
    """Connect to the interfaces of these names."""
    return OperatorInterfaces(TeleoperationClient(manipulation, operator),
                              FinishClient(manipulation), PerceptionClient(perception),
                              FinishClient(perception), image, 1.0 / rate_hz)


def think(seconds: float, limit_s: float) -> None:
    """Let simulated time pass, as a person does who thinks; at most `limit_s` of wall time."""
    end = rospy.get_time() + seconds
    until(rospy.get_time, lambda now: now >= end, limit_s)
