"""Pick an object: choose a grasp, go there, close, feel, lift, feel again."""

from typing import Callable, List, Mapping, NamedTuple, Optional, Sequence

import numpy as np

from smach_oracle.geometry.box import UprightBox
from smach_oracle.geometry.transforms import inverse

from ..kitchen import MapBox
from ..planning.arm import (
    FAST,
    FEEL_EFFORT,
    SLOW,
    Arm,
    SkillContext,
    SkillError,
    Unreachable,
    backed_off,
    lifted,
    seed_of,
    summary,
)
from ..planning.collision_map import with_margin
from ..planning.grasps import comes_from_above, grasps, others_first
from ..planning.planner import PlanningError
from ..robot import GRIPPER_OPEN

APPROACH = 0.10  # m, straight, towards the object
LIFTS = (0.10, 0.05)  # m, straight up. The lower one where the arm cannot go as high
LEAST_LIFTS = (0.03,)  # m. Encoders err: what was planned may be a little too high in the end
# N, the strongest grip there is: of what has slipped, and of what a person put into the hand
FIRM = 100.0
MISSES = 2  # grasps that may close on nothing before the skill fails
EFFORT = 40000  # collision checks for the choice of a grasp, about 3 s
# m that the hand is open beyond what it takes, where there is no room for one that is wide open:
# camera and encoders err by a centimetre
NARROW = 0.018
SPARE = 0.004  # m: what is hardly narrower than that is not tried
TARGET = 'the object'
WIDTH_ERROR = 0.015  # m by which the camera may mistake a width, and fingers may give way


class ObjectSlipped(SkillError):
    """The object did not come along when it was lifted."""


class NoGrasp(SkillError):
    """No grasp can be done from where the robot stands. The hand has not begun."""


class HeldObject(NamedTuple):
    """The object that a hand holds."""

    grasp: np.ndarray  # 4x4, base_footprint from tool, when the gripper closed
    tool_from_object: np.ndarray  # 4x4, of its centre, upright as it stood
    half: np.ndarray  # (3,) m, half extents along its axes
    effort: float = FEEL_EFFORT  # N, of the grip


Grasped = Callable[[HeldObject], None]


def nobody_told(held: HeldObject) -> None:
    """Do nothing: nobody wants to know what the hand has closed on."""


class _GraspPath(NamedTuple):
    """The path to a grasp."""

    there: np.ndarray  # (m, 7) to the place in front of the object
    approach: np.ndarray  # (k, 7) from there


def pick(
    context: SkillContext,
    arm: str,
    target: UprightBox,
    boxes: Mapping[str, MapBox],
    effort: float = FEEL_EFFORT,
    elsewhere: int = 0,
    grasped: Grasped = nobody_told,
    from_above: bool = True,
) -> HeldObject:
    """Grasp an object and lift it.

    :param arm: 'left' or 'right'.
    :param target: the object.
    :param boxes: obstacles without the object, in base_footprint.
    :param effort: N, of the grip.
    :param elsewhere: how many of the ways to grasp it have failed: they come last.
    :param grasped: is told what the hand has closed on, before it is lifted.
    :param from_above: whether the hand may come straight down. What is not quite in the middle of
        the fingers then creeps out between them.
    :raises SkillError: where that cannot be done, or the object is not in the hand in the end.
    """
    candidates = others_first(grasps(target, arm), elsewhere) if arm in ('left', 'right') else []
    obstacles = with_margin(boxes)
    obstacles[TARGET] = MapBox(target.centre, target.size / 2, target.yaw)
    with Arm(
        context, arm, obstacles, seed_of(arm, target.centre, target.size, context.robot.joints())
    ) as hand:
        if not candidates:
            raise SkillError(
                'the object is too wide for the gripper from every side: {:.0f} x {:.0f} cm'.format(
                    100 * float(target.size[0]), 100 * float(target.size[1])
                )
            )
        hand.open()
        try:
            return _pick(hand, target, _allowed(candidates, from_above), effort, grasped)
        except NoGrasp:
            gap = target.wide + NARROW
            if gap > GRIPPER_OPEN - SPARE:
                raise
            hand.open(gap)
        finer = others_first(grasps(target, arm, fine=True), elsewhere)
        try:
            return _pick(hand, target, _allowed(finer, from_above), effort, grasped)
        except NoGrasp:
            hand.open()  # half open it would look as if it held something
            raise


def _allowed(candidates: List[np.ndarray], from_above: bool) -> List[np.ndarray]:
    return [each for each in candidates if from_above or not comes_from_above(each)]


def _pick(
    hand: Arm, target: UprightBox, candidates: List[np.ndarray], effort: float, grasped: Grasped
) -> HeldObject:
    reasons: List[str] = []
    missed = 0
    for grasp in candidates:
        path = _path_to(hand, grasp, reasons) if hand.space.checks < EFFORT else None
        if path is None:
            continue
        hand.follow(path.there, FAST)
        hand.follow(path.approach, SLOW)
        gap = hand.close(effort)
        if gap > 0:
            _check_width(hand, target, gap)
            return _lift(hand, target, effort, grasped)
        missed += 1
        hand.open()
        hand.follow(path.approach[::-1], SLOW)
        if missed == MISSES:
            raise SkillError('the gripper closed on nothing, {} times'.format(MISSES))
    if missed:
        raise SkillError('the gripper closed on nothing, and there is no other grasp')
    raise NoGrasp('none of {} grasps can be done: {}'.format(len(candidates), summary(reasons)))


def _check_width(hand: Arm, target: UprightBox, gap: float) -> None:
    """Let go of what is not as wide, between the fingers, as the object is from any side.

    :raises SkillError: where it is not.
    """
    narrow, wide = target.narrow - WIDTH_ERROR, float(np.hypot(*target.size[:2])) + WIDTH_ERROR
    if narrow <= gap <= wide:
        return
    hand.open()
    raise SkillError(
        'the gripper closed on something {:.1f} cm wide, and the object is {:.1f} x {:.1f} cm: it '
        'holds another thing, or a corner'.format(
            100 * gap, 100 * float(target.size[0]), 100 * float(target.size[1])
        )
    )


def _path_to(hand: Arm, grasp: np.ndarray, reasons: List[str]) -> Optional[_GraspPath]:
    """A path to a grasp (4x4). Where there is none, None and one more reason."""
    try:
        starts = hand.reach(backed_off(grasp, APPROACH))
    except Unreachable:
        reasons.append('out of reach')
        return None
    if not starts:
        reasons.append('in collision before the object')
        return None
    for start in starts:
        with hand.space.touchable([TARGET]):
            approach = hand.line(start, grasp)
        if approach is None:
            reasons.append('no straight way to the object')
            continue
        if way_up(hand, approach[-1], grasp, LIFTS) is None:
            reasons.append('no straight way up with the object')
            continue
        try:
            return _GraspPath(hand.path(start), approach)
        except PlanningError as err:
            reasons.append(str(err))
    return None


def _lift(hand: Arm, target: UprightBox, effort: float, grasped: Grasped) -> HeldObject:
    """Lift what the gripper has closed on, and feel whether it came along."""
    grasp = hand.pose()
    held = HeldObject(grasp, inverse(grasp) @ target.matrix, target.size / 2, effort)
    grasped(held)
    hand.space.remove(TARGET)
    path = way_up(hand, hand.now(), grasp, LIFTS + LEAST_LIFTS)
    if path is None:
        hand.open(GRIPPER_OPEN)
        raise SkillError('the arm cannot lift the object from where it grasped it')
    hand.follow(path, SLOW)
    if hand.close(effort) == 0:
        raise ObjectSlipped('the object slipped out of the gripper when it was lifted')
    return held


def way_up(
    hand: Arm, start: np.ndarray, grasp: np.ndarray, heights: Sequence[float]
) -> Optional[np.ndarray]:
    """A straight path (m, 7) upwards, by the first of these heights (m) that the arm can do.

    :param start: (7,), of a hand at its grasp (4x4).
    :returns: None where it can do none.
    """
    with hand.space.touchable(hand.space.names()):
        lines = (hand.line(start, lifted(grasp, height)) for height in heights)
        return next((line for line in lines if line is not None), None)
