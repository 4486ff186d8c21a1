"""Put down what a hand holds: go above the place, lower, let go, back off, and look."""

from typing import Iterator, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from smach_oracle.geometry.transforms import from_rpy, inverse, transform

from ..fingers import LEAST_GAP
from ..kitchen import MapBox
from ..planning.arm import (
    FAST,
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
from ..planning.planner import PlanningError
from ..robot import GRIPPER_OPEN
from .pick import FIRM, HeldObject
from .spots import USUAL, free_spots

EFFORT = 40000  # collision checks for the choice of a path, about 3 s
CAREFUL = 0.25  # of the joints' velocity limits, with what has slipped before
ABOVE = 0.10  # m over the place, from where the arm goes straight down
DROP = 0.004  # m that the object falls when it is let go, more or less
RETREAT = 0.12  # m straight back afterwards
HOVER = 0.010  # m above its place, from where it is lowered until it stands
# m that the hand goes down in one step, and so many of them, to feel that the object stands. It
# does where the hand stays behind by so much: less is an edge of what leans
SETTLE, SETTLES, FELT = 0.003, 10, 0.004
GENTLE = 0.1  # of the joints' velocity limits
LOOSE = 0.006  # m that the fingers open at first
# m that the gap grows at least when something is let go. Between neighbours it grows no more
ENOUGH_TO_LET_GO = 0.02
# rad, of the object about the vertical, against how it stood
TURNS = np.linspace(-np.pi, np.pi, 24, endpoint=False)
SLACK = 0.16  # m that the height asked for may differ from the one at which the object stands

NEAR = 0.05  # m beside where it was taken, within which an object is put back there


class _PlacePath(NamedTuple):
    """The path that puts an object down."""

    there: np.ndarray  # (m, 7), to above the place
    down: np.ndarray  # (k, 7)
    gap: float  # m between the tips, to which there is room to open
    back: np.ndarray  # (j, 7), without the object


class ObjectLost(SkillError):
    """The hand turned out to be empty."""


class HoldsNothing(ObjectLost):
    """The hand was empty before it set off. It may have put down its object at an earlier try."""


def place(
    context: SkillContext,
    arm: str,
    centre: np.ndarray,
    held: HeldObject,
    boxes: Mapping[str, MapBox],
    support: str = 'table',
    tolerance: float = 0.0,
    gently: bool = False,
) -> np.ndarray:
    """Put the held object down upright, at the free spot nearest to its place.

    :param centre: (3,) m, where its centre should be, in base_footprint.
    :param boxes: obstacles, in base_footprint, without the held object.
    :param support: name of the one among them on which it should stand.
    :param tolerance: m that it may stand beside its place. 0 means 2 cm.
    :param gently: whether the hand is kept level on the way, where that can be, lowers the object
        until it is felt to stand, and lets go of it by and by.
    :returns: (3,) where its centre should be now.
    :raises SkillError: where nothing is held, no path is found, or the object is lost.
    """
    with Arm(
        context, arm, with_margin(boxes), seed_of(arm, centre, held.grasp, context.robot.joints())
    ) as hand:
        if support not in boxes:
            raise SkillError(
                'there is nothing to stand on: the collision map has no {}'.format(support)
            )
        if hand.close(held.effort) == 0:
            raise HoldsNothing('the {} hand holds nothing'.format(arm))
        drop = HOVER if gently else DROP
        centre = _on_support(centre, held, boxes[support], drop)
        hand.space.attach(held.half - 0.004, held.tool_from_object)
        spots, taken = free_spots(centre, tolerance, held.half, boxes, support)
        if not spots:
            raise SkillError(
                'no free spot within {:.0f} cm of x {:.2f}, y {:.2f} m: {} there'.format(
                    100 * max(tolerance, USUAL),
                    float(centre[0]),
                    float(centre[1]),
                    _who_stands(taken),
                )
            )
        centre, path = _find_path(hand, spots, held, support, gently)
        hand.follow(path.there, FAST if held.effort < FIRM else CAREFUL)
        if hand.close(held.effort) == 0:
            raise ObjectLost('the object was lost on the way to its place')
        hand.follow(path.down, SLOW)
        if hand.gap() < LEAST_GAP:
            raise ObjectLost('the object was lost while it was lowered')
        back = path.back
        if gently:
            _settle(hand)
            _let_stand(hand)
            back = _back_from(hand, back)
        hand.open(path.gap)
        hand.space.detach()
        hand.follow(back, SLOW)
        if path.gap < GRIPPER_OPEN:
            hand.open()
        return centre - [0.0, 0.0, drop]


def _settle(hand: Arm) -> None:
    """Lower the object until the arm gives way: what leans in the hand stands straight then.

    An arm that is held up has not failed.
    """
    wanted = hand.pose()
    for _ in range(SETTLES):
        wanted = lifted(wanted, -SETTLE)
        with hand.space.touchable(hand.space.names()):
            path = hand.line(hand.now(), wanted)
        if path is None:
            return
        try:
            hand.follow(path, GENTLE)
        except SkillError:
            return
        if hand.pose()[2, 3] > wanted[2, 3] + FELT:
            return


def _let_stand(hand: Arm) -> None:
    """Open the fingers a little: what begins to tip over is still between them."""
    hand.open(min(hand.gap() + LOOSE, GRIPPER_OPEN))


def _back_from(hand: Arm, planned: np.ndarray) -> np.ndarray:
    """A path (m, 7) straight back from where the hand is now. Where there is none, the planned."""
    with hand.space.touchable(hand.space.names()):
        path = hand.line(hand.now(), backed_off(hand.pose(), RETREAT))
    return planned if path is None else path


def put_back(
    context: SkillContext, arm: str, held: HeldObject, boxes: Mapping[str, MapBox]
) -> None:
    """Let go of an object where it was taken, if the arm is above that, elsewhere, where it is.

    :raises SkillError: where the hand does not open, or the arm does not follow its path.
    """
    with Arm(context, arm, boxes, seed_of(arm, held.grasp)) as hand:
        now = hand.pose()
        if np.hypot(*(now - held.grasp)[:2, 3]) < NEAR:
            with hand.space.touchable(hand.space.names()):
                down = hand.line(hand.now(), held.grasp)
                back = (
                    None if down is None else hand.line(down[-1], backed_off(held.grasp, RETREAT))
                )
            if down is not None and back is not None:
                hand.follow(down, SLOW)
                hand.open()
                hand.follow(back, SLOW)
                return
        hand.open()


def _on_support(centre: np.ndarray, held: HeldObject, support: MapBox, drop: float) -> np.ndarray:
    """The place asked for, `drop` m above the height at which the object stands."""
    top = support.centre[2] + support.half[2]
    inside = support.beyond(centre)
    height = top + held.half[2]
    x, y, z = centre
    if max(inside) > 0 or abs(z - height) > SLACK:
        raise SkillError(
            'there is nothing to stand on at x {:.2f}, y {:.2f}, z {:.2f} m: the support is '
            '{:.2f} m high and the place is {:.0f} cm {} its edge'.format(
                x, y, z, top, 100 * abs(max(inside)), 'beyond' if max(inside) > 0 else 'within'
            )
        )
    return np.array([x, y, height + drop])


def _who_stands(taken: Sequence[str]) -> str:
    return '{} {}'.format(' and '.join(taken), 'stand' if len(taken) > 1 else 'stands')


def _poses(
    spots: Sequence[np.ndarray], held: HeldObject
) -> Iterator[Tuple[np.ndarray, np.ndarray]]:
    """Free spots, with poses of the tool that bring the object there, best first."""
    stood = held.grasp @ held.tool_from_object
    object_from_tool = inverse(held.tool_from_object)
    for there in spots:
        for turn in sorted(TURNS, key=abs):
            rotation = from_rpy((0, 0, 0), yaw=turn)[:3, :3] @ stood[:3, :3]
            yield there, transform(there, rotation) @ object_from_tool


def _find_path(
    hand: Arm, spots: Sequence[np.ndarray], held: HeldObject, support: str, level: bool
) -> Tuple[np.ndarray, _PlacePath]:
    reasons: List[str] = []
    start = hand.now()
    for there, pose in _poses(spots, held):
        if hand.space.checks > EFFORT:
            break
        try:
            above = hand.reach(lifted(pose, ABOVE), near=start)
        except Unreachable:
            reasons.append('out of reach')
            continue
        if not above:
            reasons.append('in collision above the place')
        for q in above:
            with hand.space.touchable([support]):
                down = hand.line(q, pose)
            if down is None:
                reasons.append('no straight way down')
                continue
            release = _release(hand, down[-1], pose, held, support)
            if release is None:
                reasons.append('no room to open the fingers and draw back')
                continue
            try:
                way = hand.level_path(q, start) if level else hand.path(q, start)
                return there, _PlacePath(way, down, *release)
            except PlanningError as err:
                reasons.append(str(err))
    raise SkillError(
        'no way to put the object down at x {:.2f}, y {:.2f} m: {}'.format(
            float(spots[0][0]), float(spots[0][1]), summary(reasons)
        )
    )


def _release(
    hand: Arm, q: np.ndarray, pose: np.ndarray, held: HeldObject, support: str
) -> Optional[Tuple[float, np.ndarray]]:
    """Return how wide to open the fingers (m) and a path back (m, 7), or None if there is no room.

    :param q: (7,), of the hand at `pose` (4x4), where it lets go.
    """
    hand.space.detach()
    try:
        for gap in (GRIPPER_OPEN, min(hand.gap() + ENOUGH_TO_LET_GO, GRIPPER_OPEN)):
            with hand.opened(gap):
                with hand.space.touchable([support]):
                    fits = hand.space.is_free(q)
                back = hand.line(q, backed_off(pose, RETREAT)) if fits else None
            if back is not None:
                return gap, back
        return None
    finally:
        hand.space.attach(held.half - 0.004, held.tool_from_object)
