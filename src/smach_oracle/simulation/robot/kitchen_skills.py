"""The skills of the second use case over messages: the refrigerator's door, picking inside it, handing over."""
from smach_oracle.msg import (CloseDoorGoal, CloseDoorResult, HandOverGoal, HandOverResult, OpenDoorGoal,
                              OpenDoorResult, PickGoal, PickResult)

from ...geometry.transforms import inverse, transform
from .arm import Arm, Means, read_joints, seed_of
from .door import close_door, open_door
from .drink import things_on_shelf
from .frames import box_in_base, pose_in_base, pose_message
from .fridge_pick import pick_from_fridge
from .hand_over import hand_over
from .kitchen import Kitchen, base_from_fridge
from .manipulation import USUAL, Manipulation, known_arm
from .own_limbs import limbs_of
from .pick import FIRM, Held
from .skill_server import Say

FRIDGE = 'fridge'  # the map_id of goals that pick inside the refrigerator


class KitchenSkills(Manipulation):
    """All of Manipulation, in a kitchen."""

    def __init__(self, means: Means, kitchen: Kitchen) -> None:
        super().__init__(means)
        self.kitchen = kitchen

    def open_door(self, goal: OpenDoorGoal, say: Say) -> OpenDoorResult:
        """Open the refrigerator; what slipped before that is forgotten."""
        self.forget_slips()
        say('opening the refrigerator')
        return OpenDoorResult(angle=open_door(self.means, self.kitchen, known_arm(goal.arm)))

    def close_door(self, goal: CloseDoorGoal, say: Say) -> CloseDoorResult:
        """Push its door shut."""
        say('closing the refrigerator')
        close_door(self.means, self.kitchen, known_arm(goal.arm))
        return CloseDoorResult()

    def pick(self, goal: PickGoal, say: Say) -> PickResult:
        """Grasp an object and lift it; in the refrigerator, also take it out."""
        if goal.map_id != FRIDGE:
            return super().pick(goal, say)
        arm = known_arm(goal.arm)
        target = box_in_base(goal.object, goal.size, self.means.robot, 'object')
        fridge = base_from_fridge(self.kitchen, self.means.robot.odom_from_base())
        say('choosing a grasp in the refrigerator')
        self.held.pop(arm, None)
        limbs = limbs_of(self._links, read_joints(self.means.robot))
        others = things_on_shelf(self.means.robot.see(), self.kitchen, fridge, limbs)
        with self.firmer_after_slip() as effort:
            self.held[arm] = pick_from_fridge(self.means, self.kitchen, fridge, arm, target, others, effort)
        return PickResult(grasp=pose_message(self.held[arm].grasp))

    def hand_over(self, goal: HandOverGoal, say: Say) -> HandOverResult:
        """Set down what is held on the palm that waits for it."""
        arm = known_arm(goal.arm)
        palm = pose_in_base(goal.pose, self.means.robot, 'pose')[:3, 3]
        say('handing over')
        hand_over(self.means, arm, palm, self.held.get(arm) or unknown_held(self.means, arm))
        self.held.pop(arm, None)
        return HandOverResult()


def unknown_held(means: Means, arm: str) -> Held:
    """Something of the usual size, upright as the hand is now, held about its middle: what a person put there."""
    with Arm(means, arm, {}, seed_of(arm)) as limb:
        tool = limb.pose()
    return Held(tool, inverse(tool) @ transform(tool[:3, 3]), USUAL, FIRM)
