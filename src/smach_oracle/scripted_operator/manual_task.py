"""What the scripted operator does once an interface runs: shows a thing, or drives the hand; then says how it went."""
from typing import Any, Callable, Mapping, NamedTuple, Optional, Tuple

import numpy as np
import rospy
from geometry_msgs.msg import PoseStamped

from .eye import Eye, EyeError
from .manoeuvres import Attempt, Failed, pick, pull_out, put_down
from .pilot import Pilot, Stuck
from .plans import PUT_DOWN, SHOW, Means
from .services import Drawing, Settling, until
from .showing import show, what_to_show
from .sight import Seen, Sight
from .topic_hand import HandLink, Interrupted, TopicHand

SUCCESS = 'succeeded'
BASE = 'base_footprint'
BASE_LINK_HEIGHT = 0.051  # m of base_link above base_footprint
_BEGIN_S = 30.0  # wall time in which an interface must begin
_MISJUDGED = 0.004  # m, sigma of the places that the eye tells the hand
_SAME = 0.10  # m within which a thing is the one that was detected


class Interfaces(NamedTuple):
    """The expert's means."""

    hand: HandLink
    hand_settling: Settling
    drawing: Drawing
    drawing_settling: Settling
    image: Tuple[int, int]  # width and height of the camera's image, px
    period: float  # s, of the manipulation interface


class Job(NamedTuple):
    """One failed state to be done by hand."""

    query_id: str
    means: Means
    userdata: Mapping[str, Any]
    number: int  # of tries before
    generator: np.random.Generator


def do(job: Job, interfaces: Interfaces, eye: Eye) -> str:
    """Do the work, and end the interface's goal, whatever happens; '' where the state was superseded, else why not."""
    settling = interfaces.drawing_settling if job.means.means == SHOW else interfaces.hand_settling
    try:
        wrong = _shown(job, interfaces, eye) if job.means.means == SHOW else _driven(job, interfaces, eye)
        if not wrong:
            wrong = settling.finish(SUCCESS, 'by the scripted operator')
    except (Interrupted, rospy.ServiceException) as err:
        wrong = str(err)
    if wrong:
        settling.give_up(wrong)
    return wrong


def _shown(job: Job, interfaces: Interfaces, eye: Eye) -> str:
    interfaces.drawing.take_frame(_BEGIN_S)
    try:
        thing = what_to_show(eye.look())
    except EyeError as err:
        return str(err)
    if thing is None:
        return 'nothing of it can be seen'
    return show(interfaces.drawing.segment, thing, interfaces.image, job.generator,
                lambda: interfaces.drawing.take_frame(_BEGIN_S))


def _driven(job: Job, interfaces: Interfaces, eye: Eye) -> str:
    if not interfaces.hand.wait_for_goal(job.query_id, _BEGIN_S):
        raise Interrupted('the manipulation interface did not begin')
    try:
        hand = TopicHand(interfaces.hand, job.means.arm, BASE, interfaces.period)
        attempt = Attempt(Pilot(hand), eye.look, job.number, lambda: job.generator.normal(0.0, _MISJUDGED, 3))
        _MANOEUVRES[job.means.means](job, attempt)
    except (Failed, Stuck, EyeError) as err:
        return str(err)
    finally:
        interfaces.hand.let_go(job.means.arm)
    return ''


def _take(job: Job, attempt: Attempt) -> None:
    if job.means.inside:
        pull_out(attempt, lambda sight: target_of(job, sight))
    else:
        pick(attempt, lambda sight: target_of(job, sight))


def _put_down(job: Job, attempt: Attempt) -> None:
    sight = attempt.look()
    thing = sight.held_by(job.means.arm)
    if thing is None:
        raise Failed('the hand holds nothing')
    if job.means.onto:
        if job.means.onto not in sight.bodies:
            raise Failed('there is no {} to put it on'.format(job.means.onto))
        below = sight.bodies[job.means.onto]
        put_down(attempt, np.array([below.centre[0], below.centre[1], below.top + thing.size[2] / 2]))
        return
    place = point_in_base(job.userdata.get(job.means.place))
    if place is None:
        raise Failed('userdata {} does not say where'.format(job.means.place))
    put_down(attempt, place)


_MANOEUVRES: Mapping[str, Callable[[Job, Attempt], None]] = {'take': _take, PUT_DOWN: _put_down}


def target_of(job: Job, sight: Sight) -> Optional[Seen]:
    """The thing to take: the trial's own, or the one at the detected pose, or the nearest."""
    if sight.goal_body:
        return sight.bodies.get(sight.goal_body)
    detected = job.userdata.get(job.means.what)
    point = point_in_base(detected[0] if isinstance(detected, list) and detected else detected)
    named = sight.nearest(point, _SAME) if point is not None else None
    return named or sight.nearest(np.zeros(3), np.inf)


def point_in_base(pose: Any) -> Optional[np.ndarray]:
    """(3,) m in base_footprint of a PoseStamped in that frame or base_link; None for anything else."""
    heights = {BASE: 0.0, 'base_link': BASE_LINK_HEIGHT}
    if not isinstance(pose, PoseStamped) or pose.header.frame_id not in heights:
        return None
    at = pose.pose.position
    return np.array([at.x, at.y, at.z + heights[pose.header.frame_id]])


def connect(perception: str, manipulation: str, operator: str, image: Tuple[int, int], rate_hz: float) -> Interfaces:
    """The means of these names."""
    return Interfaces(HandLink(manipulation, operator), Settling(manipulation), Drawing(perception),
                      Settling(perception), image, 1.0 / rate_hz)


def think(seconds: float, limit_s: float) -> None:
    """Let simulated time pass, as a person does who thinks; at most `limit_s` of wall time."""
    end = rospy.get_time() + seconds
    until(rospy.get_time, lambda now: now >= end, limit_s)
