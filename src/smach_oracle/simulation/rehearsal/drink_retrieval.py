"""The second use case in one process, without ROS nodes: for tuning scenes, and for tests.

The steps are those of tasks/drink_retrieval.py, done by the same code as behind the actions.
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

TORSO_HEIGHT = 0.25  # m
MIN_HEIGHT = 0.05  # m
ORDERED = 'red'
DRIVES = {
    'MOVE_IN': (1.00, -0.20, 0.0), 'MOVE_OUT': (0.68, -0.30, 0.0),
    'MOVE_HOME': (0.0, 0.0, math.pi / 2)
}


class DrinkRetrievalRehearsal:
    """The states of the task over one world, in order."""

    def __init__(self, world: World) -> None:
        self.robot = DirectRobot(world)
        model = installed_model()
        self.skills = KitchenSkills(SkillContext(self.robot, model), Kitchen())
        self.eyes = Perception(self.robot, read_joints(model.urdf), Kitchen())
        self.data: Dict[str, Any] = {}
        palm = PoseStamped(Header(frame_id=ODOM_FRAME),
                           Pose(Point(*PALM), Quaternion(0.0, 0.0, 0.0, 1.0)))
        self.states: List[Tuple[str, Callable[[], None]]] = [
            ('RAISE_TORSO', lambda: self.robot.torso(TORSO_HEIGHT)),
            ('LOCALISE', lambda: self.skills.localise_at_fridge(LocaliseAtFridgeGoal(), no_report)),
            ('OPEN_FRIDGE', lambda: self.skills.open_door(OpenDoorGoal('right'), no_report)),
            ('MOVE_IN', lambda: self._drive('MOVE_IN')),
            ('DETECT_DRINK', self._detect),
            ('PICK_DRINK', self._pick),
            ('MOVE_OUT', lambda: self._drive('MOVE_OUT')),
            ('CLOSE_FRIDGE', lambda: self.skills.close_door(CloseDoorGoal('left'), no_report)),
            ('MOVE_HOME', lambda: self._drive('MOVE_HOME')),
            ('HAND_OVER', lambda: self.skills.hand_over(HandOverGoal('right', palm), no_report))]

    def _drive(self, state: str) -> None:
        x, y, yaw = DRIVES[state]
        self.robot.drive(from_rpy((x, y, 0.0), yaw=yaw))

    def _detect(self) -> None:
        found = self.eyes.detect_drink(DetectDrinkGoal(MIN_HEIGHT, ORDERED, 0), no_report)
        self.data.update(drink=found.drink, size=found.size)

    def _pick(self) -> None:
        goal = PickGoal(arm='right', object=self.data['drink'], size=self.data['size'],
                        map_id=FRIDGE)
        self.data['grasp'] = self.skills.pick(goal, no_report).grasp
