"""Take a drink out of the refrigerator: grasp, lift, back out with the base, carry it.

Where the program that asked for it was stopped, the drink may be in the hand, in the refrigerator
or before it. The skill goes on from there.
"""

from typing import NamedTuple, Sequence, Tuple

import numpy as np

from smach_oracle.geometry.box import UprightBox
from smach_oracle.geometry.transforms import apply, from_rpy, inverse, yaw_of

from ..kitchen import Kitchen, MapBox, base_from_fridge, odom_from_pose
from ..planning.arm import FEEL_EFFORT, SLOW, Arm, SkillContext, SkillError, seed_of
from ..planning.grasps import is_round
from ..planning.travel import carry, drive, stow
from ..robot import GRIPPER_OPEN
from .at_door import named_boxes
from .door import WIDE
from .pick import Grasped, HeldObject, NoGrasp, ObjectSlipped, nobody_told, pick, way_up

# x, y in m and yaw in rad of the base, in the fridge's frame: from there the right arm reaches
# far in
PICKING = (-0.60, -0.20, 0.0)
# m beside that, least and most, for which the base drives there: less does not matter, and from
# farther away there may be something in the way
BESIDE_PICKING = (0.10, 0.70)
# m ahead of the base, and from its middle towards the other arm: where a drink should stand for the
# second try, the third and so on
AHEAD = ((0.65, 0.21), (0.65, 0.11), (0.70, 0.11))
# x, and least and most y, m in the fridge's frame: no nearer to the fridge, and to its open door
NEAREST, BETWEEN = -0.53, (-0.40, -0.07)
STANDS_THERE = 0.02  # m
STEP_BACK = 0.40  # m that the base draws back to take the hand out
PADDING = 0.03  # m, for the fridge is not quite where the map has it
BESIDE = 0.004  # m around things on the shelf
ROUND = 0.005  # m more around what is round, in place of the corners of its box
# m that a thing on the shelf may be pushed aside, for each kind of grasp that has failed, and so
# many of them at most
PUSHED, MOST_PUSHES = 0.012, 2
LEAST_HALF = 0.005  # m of a thing that is left then
DRAWN_OUT = 0.05  # m that the base need not draw back
# N, of the grip of what is carried: a wet drink creeps out of a softer one, and pressed harder any
# drink leans more and more
CARRIED = 70.0
OFF_SHELF = 0.03  # m that a drink which is drawn out is lifted, at least
UP = (0.05, 0.03)  # m that it is lifted otherwise
SAME_SIZE = 0.02  # m between the sizes of two boxes that are the same thing
MOVED = 0.08  # m that a drive may misjudge the place of a drink
SAME = 0.03  # m between the middles of two boxes that are the same thing


class Stance(NamedTuple):
    """A way to stand before a drink, and what the hand may do from there."""

    place: int  # of the base, as an attempt has it
    from_above: bool = False  # whether the hand may come straight down
    pushes: int = 0  # how often PUSHED it may push others aside


# in this order, until there is a grasp
STANCES = (
    Stance(0),
    Stance(1),
    Stance(2),
    Stance(3),
    Stance(0, from_above=True),
    Stance(1, pushes=1),
    Stance(2, pushes=1),
)


def pick_from_fridge(
    context: SkillContext,
    kitchen: Kitchen,
    fridge: np.ndarray,
    arm: str,
    target: UprightBox,
    others: Sequence[UprightBox],
    effort: float = FEEL_EFFORT,
    elsewhere: int = 0,
    grasped: Grasped = nobody_told,
    stance: Stance = STANCES[0],
) -> HeldObject:
    """Pick a drink and take it out, upright. Where that fails, the hand leaves the fridge empty.

    :param fridge: 4x4, where it is, in base_footprint.
    :param others: what else stands on the shelf. The drink itself may be among it.
    :param effort: N, of the grip.
    :param elsewhere: as in pick().
    :param grasped: as in pick().
    :param stance: what the hand may do, where `elsewhere` is 0. Else it may do all.
    :raises SkillError: with the reason. ObjectSlipped where the drink did not come along, NoGrasp
        where the hand has not begun.
    """
    boxes = {name: _padded(box) for name, box in named_boxes(kitchen, fridge, WIDE).items()}
    boxes.update(
        {
            'thing {}'.format(k): _kept_off(box, max(elsewhere, stance.pushes))
            for k, box in enumerate(others)
            if np.hypot(*(box.centre - target.centre)[:2]) > SAME
        }
    )
    try:
        held = pick(
            context,
            arm,
            target,
            boxes,
            effort,
            elsewhere,
            grasped,
            stance.from_above or elsewhere > 0,
        )
        held = held._replace(effort=max(effort, CARRIED))
        grasped(held)
        with Arm(context, arm, {}, seed_of(arm, held.grasp)) as hand:
            hand.close(held.effort)  # so that it does not creep out on the way
        _draw_out(context)
        with Arm(context, arm, {}, seed_of(arm, held.grasp)) as hand:
            _carry(hand, held)
    except NoGrasp:
        raise
    except SkillError:
        leave(context, arm)
        raise
    return held


def beside(failed: int) -> np.ndarray:
    """(3,) m that the hand keeps from things on the shelf.

    Where drinks stand too close for a finger between them, it comes in slowly and pushes one aside.

    :param failed: how many kinds of grasp have failed.
    """
    pushed = min(failed, MOST_PUSHES) * PUSHED
    return np.array([BESIDE - pushed, BESIDE - pushed, BESIDE])


def _kept_off(box: UprightBox, failed: int) -> MapBox:
    is_cylinder = is_round(box)
    more = beside(failed) + (ROUND if is_cylinder else 0.0)
    return MapBox(box.centre, np.maximum(box.size / 2 + more, LEAST_HALF), box.yaw, is_cylinder)


def take_out(context: SkillContext, kitchen: Kitchen, arm: str, held: HeldObject) -> bool:
    """Go on with a pick that was stopped once the hand had closed on a drink.

    :returns: False where the hand turns out to hold nothing; it is open then.
    :raises SkillError: where the drink cannot be taken out. The hand keeps it.
    """
    here = inverse(base_from_fridge(kitchen, context.robot.odom_from_base()))
    inside = float(here[0, 3]) - PICKING[0] + STEP_BACK  # m that the base has not drawn back yet
    with Arm(context, arm, {}, seed_of(arm, held.grasp)) as hand:
        if hand.close(held.effort) == 0:
            hand.open()
            return False
        if inside > DRAWN_OUT and hand.pose()[2, 3] < held.grasp[2, 3] + OFF_SHELF:
            path = way_up(hand, hand.now(), hand.pose(), UP)
            if path is not None:
                hand.follow(path, SLOW)
        if inside > DRAWN_OUT:
            drive(context, context.robot.odom_from_base() @ from_rpy((-inside, 0.0, 0.0)))
        _carry(hand, held)
    return True


def _carry(hand: Arm, held: HeldObject) -> None:
    """Take a drink that is out of the fridge to the robot's side, and feel whether it came along.

    :raises ObjectSlipped: where it did not.
    """
    hand.space.attach(held.half, held.tool_from_object)
    try:
        carry(hand, level=False)
    except SkillError:  # a hand that came from above cannot stay so everywhere
        carry(hand)
    if hand.close(held.effort) == 0:
        raise ObjectSlipped('the drink was lost on the way out of the refrigerator')


def come_near(
    context: SkillContext,
    kitchen: Kitchen,
    target: UprightBox,
    arm: str,
    attempt: int,
    exactly: bool = False,
) -> UprightBox:
    """Drive to where drinks are picked from, where the base stands beside that. Look at a drink.

    Each time that a drink is picked again, the base stands otherwise. What is out of reach from one
    place, or behind something, is not so from another.

    :param target: the drink, in base_footprint.
    :param arm: 'left' or 'right'.
    :param attempt: how often it has been tried before.
    :param exactly: also where the base stands nearly there.
    :returns: the drink in base_footprint as it is then.
    :raises SkillError: where the base does not get there.
    :raises RobotError: where the head does not turn.
    """
    robot = context.robot
    before = robot.odom_from_base()
    goal = odom_from_pose(kitchen, *_picking_pose(kitchen, before, target, arm, attempt))
    least = STANDS_THERE if attempt or exactly else BESIDE_PICKING[0]
    if not least < np.hypot(*(before - goal)[:2, 3]) < BESIDE_PICKING[1]:
        return target
    drive(context, goal)
    moved = inverse(robot.odom_from_base()) @ before
    there = UprightBox(apply(moved, target.centre), target.size, target.yaw + yaw_of(moved))
    robot.look_at(there.centre)
    return there


def _picking_pose(
    kitchen: Kitchen, odom_from_base: np.ndarray, target: UprightBox, arm: str, attempt: int
) -> Tuple[float, float, float]:
    """x, y in m and yaw in rad of the base, in the fridge's frame, for a try at picking a drink."""
    if not attempt:
        return PICKING
    drink = apply(inverse(base_from_fridge(kitchen, odom_from_base)), target.centre)
    ahead, beside = AHEAD[(attempt - 1) % len(AHEAD)]
    y = drink[1] - (beside if arm == 'right' else -beside)
    return min(float(drink[0]) - ahead, NEAREST), float(np.clip(y, *BETWEEN)), 0.0


def _padded(box: MapBox) -> MapBox:
    """The box, wider by what may be wrong, not higher, for things stand on shelves."""
    return box._replace(half=box.half + [PADDING, PADDING, 0.0])


def _draw_out(context: SkillContext) -> None:
    """The base takes the arm straight out of the fridge, as it is: the arm need not be able to."""
    drive(context, context.robot.odom_from_base() @ from_rpy((-STEP_BACK, 0.0, 0.0)))


def seen_again(target: UprightBox, things: Sequence[UprightBox]) -> UprightBox:
    """The drink where it is seen now, for a drive misjudges its own way by a centimetre or two.

    :param things: what is seen on the shelf.
    """
    beside = [
        (float(np.hypot(*(box.centre - target.centre)[:2])), number)
        for number, box in enumerate(things)
        if np.abs(box.size - target.size).max() < SAME_SIZE
    ]
    distance, number = min(beside, default=(np.inf, -1))
    return things[number] if distance < MOVED else target


def leave(context: SkillContext, arm: str) -> None:
    """Take hand and base out of the fridge, so that the shelf can be seen again."""
    here = context.robot.odom_from_base()
    context.robot.gripper(arm, GRIPPER_OPEN)
    _draw_out(context)
    stow(context, (arm,), {})
    drive(context, here)
