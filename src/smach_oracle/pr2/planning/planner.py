"""Paths for an arm: around obstacles (RRT-Connect of OMPL), along straight lines, and their timing.

Effort is counted in collision checks, never in seconds, and every random draw comes from a seed:
the same question has the same answer on any day and under any load. One question at a time in a
process: OMPL's seed is global.
"""

from typing import List, Optional, Tuple

import numpy as np
from ompl import base as ompl_base
from ompl import geometric as ompl_geometric
from ompl import util as ompl_util

from smach_oracle.geometry.chain import JointChain
from smach_oracle.geometry.transforms import inverse, rotation_about, rotation_vector, transform

from .collision import CollisionWorld

BUDGET = 6000  # collision checks for one path. Most take less than 1000
RESOLUTION = 0.05  # rad (norm over the joints) between checks along a path
REACH = 0.6  # rad that a tree grows at once
STRAIGHT_STEP = 0.01  # m between checks along a line
LARGEST_JUMP = 0.35  # rad in a joint between those: more is another posture
ACCELERATION = 4.0  # rad/s2, each joint
CORNER = 0.25  # rad/s by which a joint's speed may jump where a path bends
SAMPLE = 0.04  # rad between points of a trajectory

ompl_util.setLogLevel(ompl_util.LOG_NONE)


class PlanningError(Exception):
    """No path was found. The text gives the reason."""


def plan(
    space: CollisionWorld, start: np.ndarray, goal: np.ndarray, seed: int, budget: int = BUDGET
) -> np.ndarray:
    """A path free of collision.

    :param start: (7,), where the arm is. Where it touches something by a little, it first steps out
        of it.
    :param goal: (7,), within the limits. Continuous joints go there by less than half a turn.
    :param seed: 1 or more.
    :param budget: collision checks to spend at most.
    :returns: (m, 7), from start to goal.
    :raises PlanningError: where start or goal is in collision, or the budget is spent.
    """
    chain = space.chain
    goal = chain.nearest_turn(np.asarray(goal, dtype=float), start)
    touched = space.why_not(goal)
    if touched:
        raise PlanningError('the goal is in collision: ' + touched)
    begin = step_out(space, chain.clip(start), seed)
    states = _straight_in_joints(space, begin, goal)
    if states is None:
        states = _rrt(space, begin, goal, seed, budget)
    if not np.array_equal(begin, start):
        states.insert(0, np.asarray(start, dtype=float))
    return np.array(states)


def step_out(space: CollisionWorld, start: np.ndarray, seed: int, tries: int = 200) -> np.ndarray:
    """Joint positions (7,) free of collision: `start` (7,) itself, or else some close to it.

    :raises PlanningError: where there are none close by.
    """
    if space.is_free(start):
        return start
    generator = np.random.default_rng(seed)
    for k in range(tries):
        near = space.chain.clip(start + generator.normal(0.0, 0.03 + 0.15 * k / tries, len(start)))
        if space.is_free(near):
            return near
    raise PlanningError('the arm is in collision as it is: ' + space.why_not(start))


def straight(space: CollisionWorld, start: np.ndarray, goal: np.ndarray) -> Optional[np.ndarray]:
    """A path that takes the tool along a straight line to a pose.

    :param start: (7,), where the arm is.
    :param goal: 4x4, base_footprint from tool.
    :returns: (m, 7) from the start, or None where the line leaves the reach, needs another posture,
        or meets something.
    """
    chain = space.chain
    here = chain.forward(start)
    turn = rotation_vector(goal @ inverse(here))
    length = max(
        float(np.linalg.norm(goal[:3, 3] - here[:3, 3])), 0.2 * float(np.linalg.norm(turn))
    )
    steps = max(2, int(np.ceil(length / STRAIGHT_STEP)))
    path = [np.asarray(start, dtype=float)]
    for k in range(1, steps + 1):
        q = chain.inverse(_between(here, goal, turn, k / steps), path[-1], iterations=25)
        if q is None or np.abs(q - path[-1]).max() > LARGEST_JUMP or not space.is_free(q):
            return None
        path.append(q)
    return np.array(path)


def timed(chain: JointChain, path: np.ndarray, speed: float = 0.4) -> Tuple[np.ndarray, np.ndarray]:
    """The times of a path's points, with speed and acceleration bounded.

    :param path: (m, n), m >= 1. The arm starts at its first point, at rest.
    :param speed: share of the joints' velocity limits, at most.
    :returns: positions (k, n) after the first point, and times (k,) in s, increasing. For
        Robot.follow().
    """
    points = _sampled(path)
    if len(points) < 2:
        return np.asarray(path[-1:], dtype=float), np.array([0.1])
    moves = np.diff(points, axis=0)
    lengths = np.linalg.norm(moves, axis=1)
    directions = moves / lengths[:, None]
    limits = speed * np.minimum(chain.velocity, 3.0)
    fastest = np.min(limits / np.maximum(np.abs(directions), 1e-9), axis=1)  # along each piece
    bend = np.abs(np.diff(directions, axis=0)).max(axis=1)
    speeds = np.zeros(len(points))
    speeds[1:-1] = np.minimum(
        np.minimum(fastest[:-1], fastest[1:]), CORNER / np.maximum(bend, 1e-9)
    )
    push = np.min(ACCELERATION / np.maximum(np.abs(directions), 1e-9), axis=1)
    for k in range(len(lengths)):
        speeds[k + 1] = min(speeds[k + 1], np.sqrt(speeds[k] ** 2 + 2 * push[k] * lengths[k]))
    for k in range(len(lengths) - 1, -1, -1):
        speeds[k] = min(speeds[k], np.sqrt(speeds[k + 1] ** 2 + 2 * push[k] * lengths[k]))
    durations = 2 * lengths / np.maximum(speeds[:-1] + speeds[1:], 0.02)
    return points[1:], np.cumsum(durations)


def _sampled(path: np.ndarray) -> np.ndarray:
    """The path with points at most SAMPLE apart, and none twice."""
    points: List[np.ndarray] = [np.asarray(path[0], dtype=float)]
    for corner in path[1:]:
        length = float(np.linalg.norm(corner - points[-1]))
        if length > 1e-6:
            pieces = max(1, int(np.ceil(length / SAMPLE)))
            # at least two pieces, that there is a point at which the arm may move
            points += list(np.linspace(points[-1], corner, max(2, pieces) + 1)[1:])
    return np.array(points)


def _between(here: np.ndarray, goal: np.ndarray, turn: np.ndarray, share: float) -> np.ndarray:
    angle = float(np.linalg.norm(turn))
    rotation = here[:3, :3]
    if angle > 1e-9:
        rotation = rotation_about(turn / angle, share * angle) @ rotation
    return transform(here[:3, 3] + share * (goal[:3, 3] - here[:3, 3]), rotation)


def _straight_in_joints(
    space: CollisionWorld, start: np.ndarray, goal: np.ndarray
) -> Optional[List[np.ndarray]]:
    steps = max(2, int(np.ceil(np.linalg.norm(goal - start) / RESOLUTION)))
    free = all(space.is_free(q) for q in np.linspace(start, goal, steps + 1)[1:-1])
    return [start, goal] if free else None


def _rrt(
    space: CollisionWorld, start: np.ndarray, goal: np.ndarray, seed: int, budget: int
) -> List[np.ndarray]:
    chain = space.chain
    states = ompl_base.RealVectorStateSpace(len(start))
    bounds = ompl_base.RealVectorBounds(len(start))
    for k in range(len(start)):
        turning = bool(chain.continuous[k])
        bounds.setLow(k, float(min(start[k], goal[k]) - np.pi if turning else chain.lower[k]))
        bounds.setHigh(k, float(max(start[k], goal[k]) + np.pi if turning else chain.upper[k]))
    states.setBounds(bounds)
    ompl_util.RNG.setSeed(max(1, int(seed)))
    setup = ompl_geometric.SimpleSetup(states)
    setup.setStateValidityChecker(
        lambda state: space.is_free(np.array([state[k] for k in range(len(start))]))
    )
    setup.getSpaceInformation().setStateValidityCheckingResolution(
        RESOLUTION / states.getMaximumExtent()
    )
    ends = [states.allocState(), states.allocState()]
    for state, q in zip(ends, (start, chain.clip(goal))):
        for k in range(len(start)):
            state[k] = float(q[k])
    setup.setStartAndGoalStates(*ends)
    planner = ompl_geometric.RRTConnect(setup.getSpaceInformation())
    planner.setRange(REACH)
    setup.setPlanner(planner)
    last = space.checks + budget
    setup.solve(ompl_base.PlannerTerminationCondition(lambda: space.checks >= last))
    if not setup.haveExactSolutionPath():
        raise PlanningError(
            'no way around the obstacles was found within {} collision checks'.format(budget)
        )
    path = setup.getSolutionPath()
    setup.getPathSimplifier().reduceVertices(path, 60, 30)
    return [np.array([state[k] for k in range(len(start))]) for state in path.getStates()]
