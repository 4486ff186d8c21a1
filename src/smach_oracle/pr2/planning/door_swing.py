"""Joint paths of a hand that goes with a door, and may turn about the vertical axis."""

from typing import Callable, NamedTuple, Optional, Sequence, Tuple, cast

import numpy as np

from smach_oracle.geometry.chain import JointChain

# of the hand against the door, to choose from at each step, in units of that step
TURNS = (-0.8, 0.0, 0.5, 1.0, 1.8)
MAX_JOINT_STEP = 0.35  # rad between two points of the path
ROOM = 0.35  # rad of distance to a joint's limit, beyond which more does not count
GOOD_ENOUGH = 0.999

# (door angle, turn of the hand against the door) -> 4x4, base from tool
ToolAt = Callable[[float, float], np.ndarray]
IsFree = Callable[[np.ndarray, float], bool]  # (joint positions, door angle) -> nothing collides


class DoorSwing(NamedTuple):
    """A path of an arm along a door."""

    path: np.ndarray  # (n, 7) rad
    angles: np.ndarray  # (n,) rad, of the door at these points
    share: float  # of the angle that was asked for


def best_swing(
    chain: JointChain,
    tool_at: ToolAt,
    angles: np.ndarray,
    turns: Tuple[float, float],
    seed: np.ndarray,
    generator: np.random.Generator,
    is_free: IsFree,
    may_begin: Callable[[np.ndarray], bool] = lambda q: True,
    tries: int = 45,
) -> Optional[DoorSwing]:
    """The longest path found along `angles` (rad, in order, evenly spaced).

    :param turns: rad, the least and most that the hand may be turned against the door.
    :param seed: (7,) a comfortable posture. Paths are begun near it first.
    :param may_begin: whether the arm can get to the first joint positions of a path at all.
    :returns: None where not even the first pose can be reached freely.
    """
    best: Optional[DoorSwing] = None
    # an element, which numpy's types may take for an array
    first = cast('float', angles[0])
    for _ in range(tries):
        turn = float(generator.uniform(*turns))
        starts = chain.solutions(tool_at(first, turn), seed, generator, restarts=6)
        for start in starts[:3]:
            if not (is_free(start, first) and may_begin(start)):
                continue
            swing = _follow(chain, tool_at, angles, turns, start, turn, is_free)
            if best is None or swing.share > best.share:
                best = swing
        if best is not None and best.share >= GOOD_ENOUGH:
            break
    return best


def _follow(
    chain: JointChain,
    tool_at: ToolAt,
    angles: np.ndarray,
    limits: Tuple[float, float],
    start: np.ndarray,
    turn: float,
    is_free: IsFree,
) -> DoorSwing:
    path, turns = [start], [turn]
    for before, angle in zip(angles[:-1], angles[1:]):
        options = [turns[-1] + step * abs(angle - before) for step in TURNS]
        allowed = [option for option in options if limits[0] <= option <= limits[1]]
        step = _next(chain, tool_at, angle, allowed, path[-1], is_free)
        if step is None:
            break
        path.append(step[0])
        turns.append(step[1])
    return DoorSwing(np.array(path), np.array(angles[: len(path)]), len(path) / len(angles))


def _next(
    chain: JointChain,
    tool_at: ToolAt,
    angle: float,
    turns: Sequence[float],
    q: np.ndarray,
    is_free: IsFree,
) -> Optional[Tuple[np.ndarray, float]]:
    """The next point of a path, and the hand's turn there.

    Of the points in reach, it is the one with most room for the joints.
    """
    if not turns:
        return None
    options = []
    found = chain.inverses(np.array([tool_at(angle, turn) for turn in turns]), q, iterations=15)
    for turn, reached in zip(turns, found):
        if np.abs(reached - q).max() < MAX_JOINT_STEP:  # not where there is no solution
            options.append(
                (_room(chain, reached) - 0.5 * float(np.abs(reached - q).max()), turn, reached)
            )
    for _, turn, reached in sorted(options, key=lambda option: -option[0]):
        if is_free(reached, angle):
            return reached, turn
    return None


def _room(chain: JointChain, q: np.ndarray) -> float:
    """Return the joints' room to their limits, rad: the least distance, and a little of each."""
    bounded = ~chain.continuous
    distance = np.minimum(q - chain.lower, chain.upper - q)[bounded]
    return float(np.minimum(distance, ROOM).min() + 0.1 * np.minimum(distance, ROOM).sum())
