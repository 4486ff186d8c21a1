"""The operator's work once an interface runs: show a thing or drive the hand, end the goal."""

from typing import Any, Callable, Dict, List, Mapping, NamedTuple, Optional, Tuple, cast

import numpy as np
import rospy
from geometry_msgs.msg import PoseStamped

from smach_oracle.geometry.transforms import apply, inverse

from .clearing import arm_for, free_spot, in_the_way, move_aside, move_to, on_place
from .hand_driver import HandDriver, StuckError
from .image_viewer import ImageViewer, ViewError
from .interface_clients import FinishClient, PerceptionClient
from .ladder import BY_HAND, CLEAR, CLOSER, MARK, PREPARING, UPRIGHT, NextAct
from .manoeuvres import (
    Attempt,
    ManoeuvreError,
    found,
    pick,
    pull_out,
    put_down,
    wrong_thing,
)
from .robot_means import RobotMeans
from .seen_scene import SeenScene, SeenThing
from .showing import show
from .state_plans import PUT_DOWN, StatePlan
from .topic_hand import GoalEndedError, TeleoperationClient, TopicHand
from .uprighting import set_upright, take_upright

SUCCESS = 'succeeded'
BASE = 'base_footprint'
ODOM = 'odom_combined'
BASE_LINK_HEIGHT = 0.051  # m of base_link above base_footprint
AHEAD = np.array([0.65, 0.0, 0.75])  # m, where a person looks who knows nothing better
_BEGIN_S = 30.0  # wall time in which an interface must begin
_MISJUDGED = np.array([0.007, 0.007, 0.010])  # m, sigma of the places to which a person drives
_DONE = 0.04  # m from its place: a thing that stands there is left as it is
_DRAW_S = 5.0  # of the world's time, that a drawing takes
_TAKE_HOLD_S = 5.0  # likewise, to take the wheel of a hand


class OperatorInterfaces(NamedTuple):
    """Everything the operator works with."""

    hand: TeleoperationClient
    hand_finish: FinishClient
    perception: PerceptionClient
    perception_finish: FinishClient
    eye: ImageViewer
    means: RobotMeans
    image: Tuple[int, int]  # width and height of the camera's image, px
    period: float  # s, of the manipulation interface


class ManualTask(NamedTuple):
    """One failed state to be done by hand."""

    query_id: str
    choice: NextAct
    plan: StatePlan
    userdata: Mapping[str, Any]
    number: int  # of tries before
    generator: np.random.Generator
    about: np.ndarray  # (3,) m, base_footprint, where the thing was seen last


class Result(NamedTuple):
    """The result of a task."""

    superseded: bool
    worked: bool  # what was meant came about
    text: str


def carry_out(task: ManualTask, interfaces: OperatorInterfaces) -> Result:
    """Do the work, and end the interface's goal, whatever happens."""
    shows = task.choice.act == MARK
    client = interfaces.perception_finish if shows else interfaces.hand_finish
    done = ''
    try:
        wrong = _shown(task, interfaces) if shows else _driven(task, interfaces)
        interfaces.means.end_work()  # before the machine can go on
        if not wrong and task.choice.act in PREPARING:
            done = 'it is prepared: the state itself was not done'
        elif not wrong:
            wrong = client.finish(SUCCESS, 'by the scripted operator')
    except (GoalEndedError, ViewError, rospy.ServiceException) as err:
        wrong = str(err)
    if wrong or done:
        interfaces.means.end_work()
        client.give_up(wrong or done)
    return Result(not wrong and not done, not wrong, wrong or done)


def _shown(task: ManualTask, interfaces: OperatorInterfaces) -> str:
    def look() -> Optional[SeenThing]:
        stamp = interfaces.perception.take_image(_BEGIN_S)
        interfaces.means.pass_time(_DRAW_S)
        return next(iter(interfaces.eye.wanted_at(stamp, interfaces.image)), None)

    thing = look()
    if thing is None:
        return 'nothing of it can be seen'
    return show(interfaces.perception.segment, thing, task.generator, look)


def _driven(task: ManualTask, interfaces: OperatorInterfaces) -> str:
    if not interfaces.hand.wait_for_goal(task.query_id, _BEGIN_S):
        raise GoalEndedError('the manipulation interface did not begin')
    driven: List[str] = []

    def attempt(arm: str) -> Attempt:
        if arm not in driven:
            driven.append(arm)
            interfaces.means.pass_time(_TAKE_HOLD_S)
        hand = TopicHand(interfaces.hand, arm, BASE, interfaces.period)
        return Attempt(
            HandDriver(hand),
            interfaces.means,
            task.number,
            # an array, which numpy's types may take for one number
            lambda: cast('np.ndarray', task.generator.normal(0.0, _MISJUDGED)),
        )

    try:
        _WORK[task.choice.act](task, interfaces.means, attempt)
    except (ManoeuvreError, StuckError) as err:
        return str(err)
    finally:
        for arm in driven:
            interfaces.hand.let_go(arm)
    return ''


TakeWheel = Callable[[str], Attempt]  # of an arm


def _state_by_hand(task: ManualTask, means: RobotMeans, take_wheel: TakeWheel) -> None:
    attempt = take_wheel(task.plan.arm)
    if task.plan.means == PUT_DOWN:
        _put_by_hand(task, means, attempt)
    elif task.plan.inside:
        pull_out(attempt, SeenScene.wanted, task.about)
    else:
        pick(attempt, SeenScene.wanted, task.about)


def _put_by_hand(task: ManualTask, means: RobotMeans, attempt: Attempt) -> None:
    """Put the thing where it should be, also where it lies and the hand is empty."""
    place, surface = place_of(task.plan, task.userdata, means)
    if attempt.holds:
        other = wrong_thing(attempt)
        if other:
            _put_away(attempt, task, place)
            raise ManoeuvreError('{} was in the hand: it is the wrong thing'.format(other))
    else:
        _, thing = found(attempt, SeenScene.wanted, task.about)
        lies = thing.lies(means.tall(thing.name))
        if thing.box is not None and not lies and _stands_at(thing.box.centre, place):
            return
        (take_upright if lies else pick)(attempt, SeenScene.wanted, task.about)
        place, surface = place_of(task.plan, task.userdata, means)  # nothing lies there any more
    put_down(attempt, place, surface)


def _stands_at(centre: np.ndarray, place: np.ndarray) -> bool:
    return bool(np.hypot(*(centre - place)[:2]) < _DONE)


def _put_away(attempt: Attempt, task: ManualTask, place: np.ndarray) -> None:
    """Put what the hand holds where there is room."""
    kept = [place] + [np.array(each) for each in task.plan.keep]
    scene = attempt.watcher.look_at(AHEAD)
    spot = free_spot(scene, task.plan.arm, kept, '')
    if spot is None:
        raise ManoeuvreError('the wrong thing is in the hand, and there is no room for it')
    there = np.array([spot[0], spot[1], place[2]])
    put_down(attempt, there, attempt.watcher.look_at(there).surface_at(there))


def _clear(task: ManualTask, means: RobotMeans, take_wheel: TakeWheel) -> None:
    """Move what stands beside the thing, or where something should be put."""
    kept = [] if task.plan.means != PUT_DOWN else [place_of(task.plan, task.userdata, means)[0]]
    about = kept[0] if kept else task.about

    def blocking(scene: SeenScene) -> Optional[SeenThing]:
        wanted = scene.wanted()
        if kept:
            return on_place(scene, kept[0])
        return in_the_way(scene, wanted) if wanted is not None else None

    thing = blocking(means.look_at(about))
    if thing is None or thing.box is None:
        raise ManoeuvreError('nothing is seen that is in the way')
    arm = arm_for(thing.box.centre, 'left' if kept else task.plan.arm)
    if kept and arm == task.plan.arm:
        raise ManoeuvreError('{} is in the way, and no hand is free for it'.format(thing.name))
    name = thing.name
    move_aside(
        take_wheel(arm),
        lambda scene: scene.named(name),
        thing.box.centre,
        kept + [np.array(each) for each in task.plan.keep],
    )


def _closer(task: ManualTask, means: RobotMeans, take_wheel: TakeWheel) -> None:
    """Put the thing to where the hand of the plan reaches it, with the other hand."""
    other = 'left' if task.plan.arm == 'right' else 'right'
    attempt = take_wheel(other)
    scene, thing = found(attempt, SeenScene.wanted, task.about)
    inner = 1.0 if other == 'left' else -1.0
    spots = [(x, inner * y) for y in (0.05, 0.12, 0.19) for x in (0.58, 0.64, 0.52)]
    taken = scene.boxes_but(thing.name)
    spot = next(
        (
            each
            for each in spots
            if all(
                np.hypot(each[0] - box.centre[0], each[1] - box.centre[1]) > 0.14 for box in taken
            )
        ),
        None,
    ) or free_spot(scene, other, [], thing.name)
    if spot is None or thing.box is None:
        raise ManoeuvreError('there is no room for {}'.format(thing.name))
    move_to(attempt, SeenScene.wanted, thing.box.centre, spot)


def _upright(task: ManualTask, _means: RobotMeans, take_wheel: TakeWheel) -> None:
    """Set the thing upright where it lies."""
    set_upright(take_wheel(arm_for(task.about)), SeenScene.wanted, task.about)


_WORK: Dict[str, Callable[[ManualTask, RobotMeans, TakeWheel], None]] = {
    BY_HAND: _state_by_hand,
    CLEAR: _clear,
    CLOSER: _closer,
    UPRIGHT: _upright,
}


def place_of(
    plan: StatePlan, userdata: Mapping[str, Any], means: RobotMeans
) -> Tuple[np.ndarray, Optional[float]]:
    """Return the place to put something, (3,) m in base_footprint, and the surface's height.

    :raises ManoeuvreError: where nobody knows.
    """
    if plan.onto:
        for about in plan.look or (tuple(AHEAD),):
            support = means.look_at(np.array(about), plan.onto).named(plan.onto)
            if support is not None and support.top is not None:
                return support.top, float(support.top[2])
        raise ManoeuvreError('there is no {} to be seen to put it on'.format(plan.onto))
    place = place_in_base(userdata.get(plan.place), means)
    if place is None:
        raise ManoeuvreError('userdata {} does not say where'.format(plan.place))
    seen = means.look_at(place)
    return place, seen.surface_at(place, below=float(place[2]))


def point_in_base(pose: object) -> Optional[np.ndarray]:
    """(3,) m in base_footprint, of a PoseStamped in that frame or base_link, else None."""
    heights = {BASE: 0.0, 'base_link': BASE_LINK_HEIGHT}
    if not isinstance(pose, PoseStamped) or pose.header.frame_id not in heights:
        return None
    at = pose.pose.position
    return np.array([at.x, at.y, at.z + heights[pose.header.frame_id]])


def place_in_base(pose: object, means: RobotMeans) -> Optional[np.ndarray]:
    """(3,) m in base_footprint, as point_in_base(); the pose may also be in the odometry's frame.

    :raises ViewError: where the odometry does not come.
    """
    if not isinstance(pose, PoseStamped) or pose.header.frame_id != ODOM:
        return point_in_base(pose)
    at = pose.pose.position
    found: np.ndarray = apply(inverse(means.odom_from_base()), np.array([at.x, at.y, at.z]))
    return found


class InterfaceNames(NamedTuple):
    """Names of the nodes of the two interfaces, and of the operator."""

    perception: str
    manipulation: str
    operator: str


def connect(
    names: InterfaceNames,
    eye: ImageViewer,
    means: RobotMeans,
    image: Tuple[int, int],
    rate_hz: float,
) -> OperatorInterfaces:
    """Connect to the interfaces of these names."""
    return OperatorInterfaces(
        TeleoperationClient(names.manipulation, names.operator),
        FinishClient(names.manipulation),
        PerceptionClient(names.perception),
        FinishClient(names.perception),
        eye,
        means,
        image,
        1.0 / rate_hz,
    )
