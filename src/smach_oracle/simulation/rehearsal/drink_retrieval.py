"""The second use case in one process, without ROS nodes: for tuning scenes, and for tests.

The steps are those of tasks/drink_retrieval.py, done by the same code as behind the actions. When a
state is done again, it is done otherwise, as there.
"""

import math
from typing import Any, Callable, Dict, List, Tuple

from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from std_msgs.msg import Header

from smach_oracle.geometry.joints import read_joints
from smach_oracle.geometry.transforms import from_rpy
from smach_oracle.msg import (
    CloseDoorGoal,
    DetectDrinkGoal,
    HandOverGoal,
    LocaliseAtFridgeGoal,
    OpenDoorGoal,
    PickGoal,
)
from smach_oracle.pr2.kitchen import Kitchen
from smach_oracle.pr2.nodes.kitchen_skills import FRIDGE, KitchenSkills
from smach_oracle.pr2.nodes.perception_node import Perception
from smach_oracle.pr2.planning.arm import SkillContext
from smach_oracle.pr2.planning.collision import installed_model
from smach_oracle.pr2.robot import ODOM_FRAME

from ..physics.world import World
from ..scenes.person import PALM
from .direct_robot import DirectRobot, no_report
from .pick_and_place import FAILURES

TORSO_HEIGHT = 0.25  # m
MIN_HEIGHT = 0.05  # m
ORDERED = 'red'
# x, y in m, yaw in rad, in ODOM_FRAME, in turn after each look that did not show the drink
LOOK_FROM = ((1.00, -0.20, 0.0), (1.00, -0.20, 0.0), (1.00, -0.60, 0.0))
DRIVES = {'MOVE_OUT': (0.68, -0.30, 0.0), 'MOVE_HOME': (0.0, 0.0, math.pi / 2)}


class DrinkRetrievalRehearsal:
    """The states of the task over one world, in order."""

    def __init__(self, world: World) -> None:
        self.robot = DirectRobot(world)
        model = installed_model()
        self.skills = KitchenSkills(SkillContext(self.robot, model), Kitchen())
        self.eyes = Perception(self.robot, read_joints(model.urdf), Kitchen())
        palm = PoseStamped(
            Header(frame_id=ODOM_FRAME), Pose(Point(*PALM), Quaternion(0.0, 0.0, 0.0, 1.0))
        )
        self.states: List[Tuple[str, Callable[[], None]]] = [
            ('RAISE_TORSO', lambda: self.robot.torso(TORSO_HEIGHT)),
            ('LOCALISE', lambda: self.skills.localise_at_fridge(LocaliseAtFridgeGoal(), no_report)),
            ('OPEN_FRIDGE', lambda: self.skills.open_door(OpenDoorGoal('right'), no_report)),
            ('MOVE_IN', lambda: self._drive(*self.looks_from())),
            ('DETECT_DRINK', self._detect),
            ('PICK_DRINK', self._pick),
            ('MOVE_OUT', lambda: self._drive(*DRIVES['MOVE_OUT'])),
            ('CLOSE_FRIDGE', lambda: self.skills.close_door(CloseDoorGoal('left'), no_report)),
            ('MOVE_HOME', lambda: self._drive(*DRIVES['MOVE_HOME'])),
            ('HAND_OVER', lambda: self.skills.hand_over(HandOverGoal('right', palm), no_report)),
        ]
        self.begin()

    def begin(self) -> None:
        """See Rehearsal."""
        self.data: Dict[str, Any] = {}
        self.missed = self.picks = 0  # looks that did not show the drink, and picks

    def looks_from(self) -> Tuple[float, float, float]:
        """Return the place to which the state MOVE_IN drives."""
        return LOOK_FROM[self.missed % len(LOOK_FROM)]

    def detect_goal(self) -> DetectDrinkGoal:
        """Return the goal of the state DETECT_DRINK."""
        return DetectDrinkGoal(MIN_HEIGHT, ORDERED, self.missed % 256)

    def pick_goal(self) -> PickGoal:
        """Return the goal of the state PICK_DRINK."""
        self.picks += 1
        return PickGoal(
            'right', self.data['drink'], self.data['size'], FRIDGE, min(self.picks - 1, 255)
        )

    def _drive(self, x: float, y: float, yaw: float) -> None:
        self.robot.drive(from_rpy((x, y, 0.0), yaw=yaw))

    def _detect(self) -> None:
        try:
            found = self.eyes.detect_drink(self.detect_goal(), no_report)
        except FAILURES:
            self.missed += 1
            raise
        self.data.update(drink=found.drink, size=found.size)

    def _pick(self) -> None:
        self.data['grasp'] = self.skills.pick(self.pick_goal(), no_report).grasp
