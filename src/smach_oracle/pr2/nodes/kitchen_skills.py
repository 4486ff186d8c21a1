"""The skills of the second use case over messages: the door, picking inside it, handing over."""

from functools import partial
from typing import Optional

from smach_oracle.geometry.box import UprightBox
from smach_oracle.geometry.links import link_pose
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
from ..perception.upright import look_of
from ..planning.arm import (
    Arm,
    SkillContext,
    SkillError,
    encoder_readings,
    known_arm,
    seed_of,
)
from ..robot import BASE_FRAME, GRIPPER_OPEN, TOOL_FRAME
from ..skills.door import close_door, open_door
from ..skills.fridge_pick import (
    STANCES,
    Stance,
    come_near,
    leave,
    pick_from_fridge,
    seen_again,
    take_out,
)
from ..skills.hand_over import hand_over
from ..skills.localise import localise_at_fridge
from ..skills.pick import FIRM, HeldObject, NoGrasp
from .frames import box_in_base, pose_in_base, pose_message
from .manipulation import USUAL, Manipulation, check_is_there, elsewhere_of
from .skill_server import ReportStatus

FRIDGE = 'fridge'  # the map_id of goals that pick inside the refrigerator


class KitchenSkills(Manipulation):
    """All of Manipulation, in a kitchen."""

    def __init__(self, context: SkillContext, kitchen: Kitchen) -> None:
        super().__init__(context)
        self.kitchen = kitchen

    def localise_at_fridge(
        self, goal: LocaliseAtFridgeGoal, report: ReportStatus
    ) -> LocaliseAtFridgeResult:
        """Look at the refrigerator, and set right where the robot believes to stand."""
        self.hands.feel(self.context.robot)
        report('looking where the refrigerator stands')
        found = localise_at_fridge(self.context, self.kitchen)
        return LocaliseAtFridgeResult(x=found.x, y=found.y, yaw=found.yaw)

    def open_door(self, goal: OpenDoorGoal, report: ReportStatus) -> OpenDoorResult:
        """Open the refrigerator. What slipped before that is forgotten."""
        self.forget_slips()
        self.hands.feel(self.context.robot)
        report('opening the refrigerator')
        return OpenDoorResult(angle=open_door(self.context, self.kitchen, known_arm(goal.arm)))

    def close_door(self, goal: CloseDoorGoal, report: ReportStatus) -> CloseDoorResult:
        """Push its door shut."""
        report('closing the refrigerator')
        close_door(self.context, self.kitchen, known_arm(goal.arm))
        return CloseDoorResult()

    def pick(self, goal: PickGoal, report: ReportStatus) -> PickResult:
        """Grasp an object and lift it. In the refrigerator, also take it out.

        What an earlier pick has closed on, and the hand still holds, is taken out.
        """
        if goal.map_id != FRIDGE:
            return super().pick(goal, report)
        arm = known_arm(goal.arm)
        robot = self.context.robot
        target = box_in_base(goal.object, goal.size, robot, 'object')
        self.hands.feel(robot)
        held = self._taken_out(arm, report)
        if held is None:
            if self._is_inside(arm):
                report('taking the hand out of the refrigerator')
                leave(self.context, arm)
            robot.gripper(arm, GRIPPER_OPEN)
            held = self._pick_from_somewhere(goal, arm, target, report)
        return PickResult(grasp=pose_message(held.grasp))

    def _pick_from_somewhere(
        self, goal: PickGoal, arm: str, target: UprightBox, report: ReportStatus
    ) -> HeldObject:
        """Pick a drink from the first place of the base from which there is a grasp."""
        for stance in STANCES:
            there = come_near(
                self.context,
                self.kitchen,
                target,
                arm,
                goal.attempt + stance.place,
                stance is not STANCES[0],
            )
            try:
                return self._pick_inside(goal, arm, there, there is not target, stance, report)
            except NoGrasp:
                if stance is STANCES[-1]:
                    raise
            target = there
        raise SkillError('there is no place to pick from')

    def _is_inside(self, arm: str) -> bool:
        """Whether a hand is in the refrigerator."""
        fridge = base_from_fridge(self.kitchen, self.context.robot.odom_from_base())
        joints = encoder_readings(self.context.robot)
        tool = link_pose(self._links, BASE_FRAME, TOOL_FRAME[arm], joints)
        return bool((inverse(fridge) @ tool)[0, 3] > 0.0)

    def _taken_out(self, arm: str, report: ReportStatus) -> Optional[HeldObject]:
        """Go on with an earlier pick, where the hand still holds what it has closed on.

        :returns: that, or None where there is nothing.
        """
        held = self.hands.find(arm)
        if held is None:
            return None
        report('taking out what the {} hand holds'.format(arm))
        try:
            return held if take_out(self.context, self.kitchen, arm, held) else None
        finally:
            self.hands.feel(self.context.robot)

    def _pick_inside(
        self,
        goal: PickGoal,
        arm: str,
        target: UprightBox,
        driven: bool,
        stance: Stance,
        report: ReportStatus,
    ) -> HeldObject:
        """Pick a drink from where the base stands.

        :param driven: whether the base has driven since the drink was seen.
        """
        report('choosing a grasp in the refrigerator')
        robot = self.context.robot
        fridge = base_from_fridge(self.kitchen, robot.odom_from_base())
        limbs = limbs_of(self._links, encoder_readings(robot))
        image = robot.see()
        check_is_there(image, target)
        others = things_on_shelf(image, self.kitchen, fridge, limbs)
        target = seen_again(target, others) if driven else target
        self.hands.send(arm, look_of(image, target))
        try:
            with self.firmer_after_slip(goal.attempt) as effort:
                held = pick_from_fridge(
                    self.context,
                    self.kitchen,
                    fridge,
                    arm,
                    target,
                    others,
                    effort,
                    elsewhere_of(goal.attempt),
                    partial(self.hands.keep, arm),
                    stance,
                )
        except SkillError:
            self.hands.feel(robot)
            raise
        return held

    def hand_over(self, goal: HandOverGoal, report: ReportStatus) -> HandOverResult:
        """Set down what is held on the palm that waits for it."""
        arm = known_arm(goal.arm)
        palm = pose_in_base(goal.pose, self.context.robot, 'pose')[:3, 3]
        report('handing over')
        self.hands.feel(self.context.robot)
        with self.telling_of_losses(arm):
            held = self.hands.find(arm) or unknown_held(self.context, arm)
            hand_over(self.context, arm, palm, held, self.hands.meant(arm))
        return HandOverResult()


def unknown_held(context: SkillContext, arm: str) -> HeldObject:
    """Something of the usual size that a person put into the hand.

    It is taken to be upright as the hand is now, and held about its middle.
    """
    with Arm(context, arm, {}, seed_of(arm)) as limb:
        tool = limb.pose()
    return HeldObject(tool, inverse(tool) @ transform(tool[:3, 3]), USUAL, FIRM)
