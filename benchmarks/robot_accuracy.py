#!/usr/bin/env python3
"""The accuracy of the simulated robot, in one process without ROS, and what its work costs.

    benchmarks/robot_accuracy.py [--table N] [--kitchen N] [--first SEED]

A can is gripped, lifted and shaken; then both tasks are run in N scenes each that have no cause to
fail. Compare its figures before and after a change of the world's physics. Scenes are tuned on
seeds below 1000: use those here.
"""

import argparse
import re
import time
from typing import Dict, List, NamedTuple, Sequence

import numpy as np

from smach_oracle.geometry.chain import JointChain
from smach_oracle.geometry.transforms import from_rpy, inverse
from smach_oracle.pr2.model.pr2_model import pr2_urdf
from smach_oracle.pr2.robot import ARM_JOINTS, BASE_FRAME, TOOL_FRAME
from smach_oracle.simulation.physics.judge import judge
from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.rehearsal.direct_robot import DirectRobot
from smach_oracle.simulation.rehearsal.drink_retrieval import DrinkRetrievalRehearsal
from smach_oracle.simulation.rehearsal.pick_and_place import FAILURES, PickAndPlaceRehearsal
from smach_oracle.simulation.scenes.fridge import DOOR_JOINT
from smach_oracle.simulation.scenes.scene import Body, Goal, Scene
from smach_oracle.simulation.scenes.tasks import draw

TASKS = {'pick_and_place': PickAndPlaceRehearsal, 'drink_retrieval': DrinkRetrievalRehearsal}
# kg, friction of the can, N: what the hand holds, and what it must lose
GRASPS = ((0.33, 0.8, 20.0), (0.33, 0.8, 40.0), (0.7, 0.6, 90.0), (0.33, 0.04, 20.0))
CAN_HEIGHT = 0.12  # m
# rad; the shoulder as fast to and fro as its motor can
SHAKE = np.array([0.04, 0.0, 0.0, 0.12, 0.0, 0.12, 0.4])
ANGLES = ('OPEN_FRIDGE', 'CLOSE_FRIDGE')


class TrialOutcome(NamedTuple):
    """The outcome of one trial without a cause."""

    seed: int
    failed: str  # the state, '' for none
    text: str  # of the failure, or the judge's
    success: bool
    off_cm: float  # from the goal
    door: Dict[str, float]  # degrees after the states that move it
    cpu_s: float
    sim_s: float


def grasp_scene(mass: float, friction: float) -> Scene:
    """A can on a table."""
    table = Body('table', 'box', (0.7, 1.4, 0.04), (0.85, 0.0, 0.70))
    can = Body(
        'can',
        'cylinder',
        (0.031, 0.031, CAN_HEIGHT),
        (0.70, -0.20, 0.78),
        mass=mass,
        friction=friction,
    )
    return Scene('grasp', 3, (table, can), Goal('stands_at', ''))


class BlindHand:
    """The right hand, that knows where things are."""

    def __init__(self, world: World) -> None:
        self._world, self._robot = world, DirectRobot(world)
        self._chain = JointChain.from_urdf(
            pr2_urdf().read_text(),
            BASE_FRAME,
            TOOL_FRAME['right'],
            fixed={'torso_lift_joint': world.joints()['torso_lift_joint']},
        )

    def angles(self) -> np.ndarray:
        joints = self._robot.joints()
        return np.array([joints[name] for name in ARM_JOINTS['right']])

    def go(self, pose: np.ndarray, points: int) -> None:
        """The tool to a pose in the base's frame, on a line of so many points."""
        angles = self.angles()
        start, way = self._chain.forward(angles), []
        for share in np.linspace(0, 1, points + 1)[1:]:
            between = pose.copy()
            between[:3, 3] = start[:3, 3] + share * (pose[:3, 3] - start[:3, 3])
            chance = np.random.default_rng(0) if points == 1 else None
            found = self._chain.inverse(between, angles, chance)
            if found is None:
                raise SystemExit('the can is out of reach')
            angles = self._chain.nearest_turn(found, angles)
            way.append(angles)
        steps = np.abs(np.diff([self.angles()] + way, axis=0)).max(axis=1) / 0.8
        self._robot.follow(ARM_JOINTS['right'], np.array(way), np.cumsum(np.maximum(steps, 0.02)))

    def take(self, effort: float) -> None:
        """Grasp the can and lift it."""
        centre = (inverse(self._world.true_base()) @ self._world.body_pose('can'))[:3, 3]
        self.go(from_rpy(centre - 0.13 * np.array([np.cos(0.3), np.sin(0.3), 0.0]), yaw=0.3), 1)
        self.go(from_rpy(centre, yaw=0.3), 8)
        self._robot.gripper('right', 0.0, effort)
        self.go(from_rpy(centre + [0.0, 0.0, 0.1], yaw=0.3), 8)

    def shake(self) -> None:
        """Wrist, elbow and shoulder to and fro, for 6 s."""
        rest = self.angles()
        way = np.array([rest + SHAKE * (-1) ** k for k in range(20)] + [rest])
        self._robot.follow(ARM_JOINTS['right'], way, 0.3 * np.arange(1, len(way) + 1))


def slip(mass: float, friction: float, effort: float) -> str:
    """By how much a can slips in the hand, in words."""
    world = World(grasp_scene(mass, friction))
    try:
        hand = BlindHand(world)
        hand.take(effort)
        if world.holding('can') != 'right':
            return 'not held'
        before = inverse(world.tool_pose('right')) @ world.body_pose('can')
        hand.shake()
        if world.holding('can') != 'right':
            return 'lost in the shake'
        after = inverse(world.tool_pose('right')) @ world.body_pose('can')
        turn = np.degrees(np.arccos(np.clip(before[:3, 2] @ after[:3, 2], -1.0, 1.0)))
        return '{:.1f} mm, {:.1f} degrees'.format(
            1000 * np.linalg.norm(after[:3, 3] - before[:3, 3]), turn
        )
    finally:
        world.close()


def trial(task: str, seed: int, world: World) -> TrialOutcome:
    """One trial up to its first failure, without a cause to fail."""
    scene = draw(task, seed, True)
    cpu = time.process_time()
    world.reset(scene)
    start, door, failed, text = world.time, {}, '', ''
    for name, work in TASKS[task](world).states:
        try:
            work()
        except FAILURES as err:
            failed, text = name, str(err)
            break
        if name in ANGLES:
            door[name] = float(np.degrees(world.body_joint('fridge', DOOR_JOINT)))
    sim_s = world.time - start
    world.step(60)
    verdict = judge(world, scene.goal)
    number = re.search(r'([\d.]+) cm', verdict.why)
    return TrialOutcome(
        seed,
        failed,
        text or verdict.why,
        verdict.success,
        float(number.group(1)) if number else np.nan,
        door,
        time.process_time() - cpu,
        sim_s,
    )


def report(task: str, outcomes: Sequence[TrialOutcome]) -> None:
    """Print how the trials of a task went."""
    good = [each for each in outcomes if each.success]
    print(
        '\n{}: {} of {} succeed; {:.2f} processor s and {:.1f} s of simulated time each'.format(
            task,
            len(good),
            len(outcomes),
            np.mean([each.cpu_s for each in outcomes]),
            np.mean([each.sim_s for each in outcomes]),
        )
    )
    print('  off the goal: {}'.format(spread([each.off_cm for each in good], 'cm')))
    for state in ANGLES:
        angles = [each.door[state] for each in outcomes if state in each.door]
        if angles:
            print('  the door after {}: {}'.format(state, spread(angles, 'degrees')))
    for each in outcomes:
        if not each.success:
            print('  seed {}: {} {}'.format(each.seed, each.failed or 'false success', each.text))


def spread(values: List[float], unit: str) -> str:
    """Least, median and most."""
    known = [value for value in values if np.isfinite(value)]
    return (
        '{:.2f} / {:.2f} / {:.2f} {} (least, median, most of {})'.format(
            min(known), float(np.median(known)), max(known), unit, len(known)
        )
        if known
        else 'none'
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        '--table', type=int, default=40, help='trials of pick and place (default: %(default)s)'
    )
    parser.add_argument(
        '--kitchen', type=int, default=15, help='trials of drink retrieval (default: %(default)s)'
    )
    parser.add_argument(
        '--first', type=int, default=500, help='seed of the first trial (default: %(default)s)'
    )
    args = parser.parse_args()
    for mass, friction, effort in GRASPS:
        print(
            'a can of {} kg, friction {}, gripped with {:g} N and shaken: {}'.format(
                mass, friction, effort, slip(mass, friction, effort)
            ),
            flush=True,
        )
    world = World()
    for task, count in (('pick_and_place', args.table), ('drink_retrieval', args.kitchen)):
        if count:
            report(task, [trial(task, args.first + k, world) for k in range(count)])
    world.close()


if __name__ == '__main__':
    main()
