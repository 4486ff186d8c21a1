"""The skills of the second use case over messages: the door, picking inside it, handing over."""
from smach_oracle.geometry.transforms import inverse, transform
from smach_oracle.msg import (
    CloseDoorGoal,
    CloseDoorResult,
    HandOverGoal,
    HandOverResult,
    LocaliseAtFridgeGoal,
    LocaliseAtFridgeResult,
    OpenDoorGoal,
    OpenDoorResult,
    PickGoal,
    PickResult,
)

from ..kitchen import Kitchen, base_from_fridge
from ..perception.drink import things_on_shelf
from ..perception.own_limbs import limbs_of
from ..planning.arm import Arm, SkillContext, encoder_readings, known_arm, seed_of
from ..skills.door import close_door, open_door
from ..skills.fridge_pick import pick_from_fridge
from ..skills.hand_over import hand_over
from ..skills.localise import localise_at_fridge
from ..skills.pick import FIRM, HeldObject
from .frames import box_in_base, pose_in_base, pose_message
from .manipulation import USUAL, Manipulation, check_is_there, elsewhere_of
from .skill_server import ReportStatus

FRIDGE = 'fridge'  # the map_id of goals that pick inside the refrigerator


class KitchenSkills(Manipulation):
    """All of Manipulation, in a kitchen."""

    def __init__(self, context: SkillContext, kitchen: Kitchen) -> None:
        super().__init__(context)
        self.kitchen = kitchen

    def localise_at_fridge(self, goal: LocaliseAtFridgeGoal,
                           report: ReportStatus) -> LocaliseAtFridgeResult:
        """Look at the refrigerator, and set right where the robot believes to stand."""
        report('looking where the refrigerator stands')
        found = localise_at_fridge(self.context, self.kitchen)
        return LocaliseAtFridgeResult(x=found.x, y=found.y, yaw=found.yaw)

    def open_door(self, goal: OpenDoorGoal, report: ReportStatus) -> OpenDoorResult:
        """Open the refrigerator; what slipped before that is forgotten."""
        self.forget_slips()
        report('opening the refrigerator')
        return OpenDoorResult(angle=open_door(self.context, self.kitchen, known_arm(goal.arm)))

    def close_door(self, goal: CloseDoorGoal, report: ReportStatus) -> CloseDoorResult:
        """Push its door shut."""
        report('closing the refrigerator')
        close_door(self.context, self.kitchen, known_arm(goal.arm))
        return CloseDoorResult()

    def pick(self, goal: PickGoal, report: ReportStatus) -> PickResult:
        """Grasp an object and lift it; in the refrigerator, also take it out."""
        if goal.map_id != FRIDGE:
            return super().pick(goal, report)
        arm = known_arm(goal.arm)
        target = box_in_base(goal.object, goal.size, self.context.robot, 'object')
        fridge = base_from_fridge(self.kitchen, self.context.robot.odom_from_base())
        report('choosing a grasp in the refrigerator')
        self.held.pop(arm, None)
        limbs = limbs_of(self._links, encoder_readings(self.context.robot))
        image = self.context.robot.see()
        check_is_there(image, target)
        others = things_on_shelf(image, self.kitchen, fridge, limbs)
        with self.firmer_after_slip(goal.attempt) as effort:
            self.held[arm] = pick_from_fridge(self.context, self.kitchen, fridge, arm, target,
                                              others, effort, elsewhere_of(goal.attempt))
        return PickResult(grasp=pose_message(self.held[arm].grasp))

    def hand_over(self, goal: HandOverGoal, report: ReportStatus) -> HandOverResult:
        """Set down what is held on the palm that waits for it."""
        arm = known_arm(goal.arm)
        palm = pose_in_base(goal.pose, self.context.robot, 'pose')[:3, 3]
        report('handing over')
        hand_over(self.context, arm, palm, self.held.get(arm) or unknown_held(self.context, arm))
        self.held.pop(arm, None)
        return HandOverResult()


def unknown_held(context: SkillContext, arm: str) -> HeldObject:
    """Something of the usual size that a person put into the hand.

    It is taken to be upright as the hand is now, and held about its middle.
    """
    with Arm(context, arm, {}, seed_of(arm)) as limb:
        tool = limb.pose()
    return HeldObject(tool, inverse(tool) @ transform(tool[:3, 3]), USUAL, FIRM)
