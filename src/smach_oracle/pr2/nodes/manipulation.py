"""The manipulation skills over messages: goals in, results out. The node gives them servers."""

import contextlib
from functools import partial
from typing import Dict, Iterator, List, Mapping, Optional, Sequence, Tuple, Type

import numpy as np

from smach_oracle.geometry.box import UprightBox
from smach_oracle.geometry.camera_image import CameraImage
from smach_oracle.geometry.joints import read_joints
from smach_oracle.geometry.links import link_pose
from smach_oracle.geometry.transforms import inverse, yaw_of
from smach_oracle.msg import (
    BuildCollisionMapGoal,
    BuildCollisionMapResult,
    MoveArmsAsideGoal,
    MoveArmsAsideResult,
    PickGoal,
    PickResult,
    PlaceGoal,
    PlaceResult,
    PointHeadGoal,
    PointHeadResult,
)
from smach_oracle.oracle.number_checks import is_number

from ..fingers import may_hold, stands_open
from ..kitchen import MapBox
from ..perception.absence import sees_past
from ..perception.clusters import NotSeen
from ..perception.own_limbs import limbs_of
from ..perception.tabletop import SAME_SIZE, find_tabletop, things_on_table
from ..perception.upright import look_of, why_not_standing
from ..planning.arm import (
    FEEL_EFFORT,
    SLOW,
    Arm,
    SkillContext,
    SkillError,
    encoder_readings,
    known_arm,
    seed_of,
)
from ..planning.collision_map import (
    MOST_BOXES,
    PADDING,
    TABLE,
    CollisionMap,
    CollisionMapStore,
    around,
    map_of,
    map_of_image,
    nearest_object,
)
from ..planning.travel import draw_back
from ..robot import ARMS, BASE_FRAME, TOOL_FRAME
from ..skills.arms_aside import arms_aside, is_aside
from ..skills.hand_memory import HandMemory, MindfulRobot
from ..skills.pick import FIRM, HeldObject, ObjectSlipped, pick
from ..skills.place import NEAR, RETREAT, HoldsNothing, ObjectLost, place, put_back
from ..skills.spots import FARTHEST
from ..skills.spots import USUAL as USUAL_SPOT
from .frames import box_in_base, point_in_base, pose_in_base, pose_message
from .skill_server import ReportStatus

# m, of any table: a goal gives only its middle, and the direction of its long side
TABLE_SIZE = np.array([1.4, 0.7, 0.0])
SAME_GRASP = 0.02  # m between two poses of the tool that are taken for the same grasp
BESIDE_GRASP = 0.07  # m from the tool to the middle of what it grasped, at most
ABOUT = 0.25  # m around a place within which what stands there counts
KNOWN = 0.04  # m between the middles of two boxes that are the same thing
USUAL = np.array([0.03, 0.03, 0.06])  # m, half extents of a held thing that nothing is known of


def elsewhere_of(attempt: int) -> int:
    """Return how many ways to grasp a thing have failed.

    The first way is tried twice, firmer the second time.

    :param attempt: of a goal.
    """
    return max(0, attempt - 1)


def _without_table(boxes: Mapping[str, MapBox]) -> List[MapBox]:
    return [box for name, box in boxes.items() if name != TABLE]


def check_is_there(image: CameraImage, target: UprightBox) -> None:
    """Refuse to reach for a thing that somebody has taken away: the hand would knock others over.

    :raises SkillError: where the image shows that the target is gone.
    """
    if sees_past(image, target):
        raise SkillError('the object is no longer where it was seen: the camera sees past it')


class Manipulation:
    """Arms aside, head, collision map, pick and place, as answers to goals.

    A goal that cannot be reached, or makes no sense, ends in a SkillError, RobotError or
    PlanningError with the reason.
    """

    def __init__(self, context: SkillContext) -> None:
        self.hands = HandMemory()
        self.context = context._replace(robot=MindfulRobot(context.robot, self.hands))
        self.maps = CollisionMapStore()
        self._effort = FEEL_EFFORT  # N, of the next grip
        self._begins = True  # whether the arms were aside since the last pick
        self._links = read_joints(context.model.urdf)

    def move_arms_aside(self, goal: MoveArmsAsideGoal, report: ReportStatus) -> MoveArmsAsideResult:
        """Move both arms, or those named, to the robot's sides.

        The first try of a pick after that forgets what slipped before. What a hand still holds over
        the spot where it took it is put down there first.
        """
        self._begins = True
        self.hands.feel(self.context.robot)
        for arm in goal.arms:
            known_arm(arm)
        arms = list(goal.arms) or list(ARMS)
        joints = encoder_readings(self.context.robot)
        boxes: Dict[str, MapBox] = {}
        if not all(is_aside(joints, arm) for arm in arms):
            self._return_held(arms, report)
            report('looking for what is in the way')
            boxes = self._seen().boxes
        arms_aside(self.context, arms, boxes)
        return MoveArmsAsideResult()

    def point_head(self, goal: PointHeadGoal, report: ReportStatus) -> PointHeadResult:
        """The camera's axis to a point."""
        point = point_in_base(goal.target, self.context.robot, 'target')
        report('moving the head')
        self.context.robot.look_at(point)
        return PointHeadResult()

    def build_collision_map(
        self, goal: BuildCollisionMapGoal, report: ReportStatus
    ) -> BuildCollisionMapResult:
        """Boxes of the table and the objects, under an id.

        :raises SkillError: for a pose or size that is not allowed, where there are more objects
            than sizes, or fewer, and for more than MOST_BOXES of them.
        """
        robot = self.context.robot
        if len(goal.objects) != len(goal.sizes):
            raise SkillError('{} objects but {} sizes'.format(len(goal.objects), len(goal.sizes)))
        if len(goal.objects) > MOST_BOXES:
            raise SkillError(
                '{} objects; allowed: at most {}'.format(len(goal.objects), MOST_BOXES)
            )
        objects = [
            box_in_base(pose, size, robot, 'objects[{}]'.format(k))
            for k, (pose, size) in enumerate(zip(goal.objects, goal.sizes))
        ]
        centre = pose_in_base(goal.table, robot, 'table')
        made = map_of(UprightBox(centre[:3, 3], TABLE_SIZE, yaw_of(centre)), objects)
        return BuildCollisionMapResult(map_id=self.maps.keep(made), boxes=len(made.boxes))

    def pick(self, goal: PickGoal, report: ReportStatus) -> PickResult:
        """Grasp an object and lift it."""
        arm = known_arm(goal.arm)
        target = box_in_base(goal.object, goal.size, self.context.robot, 'object')
        self.hands.feel(self.context.robot)
        made = self.maps.find(goal.map_id) if goal.map_id else self._seen(target)
        boxes = around(made, target)
        self._put_back(arm, boxes)
        report('looking whether the object is still there')
        image = self.context.robot.see()
        check_is_there(image, target)
        self.hands.send(arm, look_of(image, target))
        report('choosing a grasp')
        with self._withdrawing(arm, boxes):
            if self._begins and not goal.attempt:
                self.forget_slips()
            self._begins = False
            # only after a slip: what does not slip may tilt where it is pressed hard
            with self.firmer_after_slip() as effort:
                held = pick(
                    self.context,
                    arm,
                    target,
                    boxes,
                    effort,
                    elsewhere_of(goal.attempt),
                    partial(self.hands.keep, arm),
                )
        return PickResult(grasp=pose_message(held.grasp))

    def place(self, goal: PlaceGoal, report: ReportStatus) -> PlaceResult:
        """Look at the place, put down what is held at a free spot, and look whether it stands.

        An empty hand succeeds where a thing like that stands there, and the map has none there.

        :raises SkillError: where there is no such spot, the hand has lost its object, the object
            lies or leans in the end, or it is another one than PICK was sent to take.
        """
        arm = known_arm(goal.arm)
        robot = self.context.robot
        if not is_number(goal.tolerance, 0, FARTHEST):
            raise SkillError('tolerance is {} m; allowed: 0 to {}'.format(goal.tolerance, FARTHEST))
        centre = pose_in_base(goal.pose, robot, 'pose')[:3, 3]
        grasp = pose_in_base(goal.grasp, robot, 'grasp')
        self.hands.feel(robot)
        made = self.maps.find(goal.map_id) if goal.map_id else self._seen()
        held, boxes = self._held_object(arm, grasp, made)
        report('looking at the place')
        if (
            stands_open(encoder_readings(robot), arm)
            and not self.hands.has_lost(arm)
            and not self._why_not_placed(arm, centre, goal.tolerance, held, made)
        ):
            return PlaceResult()
        boxes.update(self._standing_at(arm, centre, goal.tolerance, held, boxes))
        report('choosing a way')
        try:
            with self._withdrawing(arm, boxes, ObjectLost), self.firmer_after_slip():
                with self.telling_of_losses(arm):
                    stood = place(self.context, arm, centre, held, boxes, tolerance=goal.tolerance)
        except HoldsNothing as err:
            why = self._why_not_placed(arm, centre, goal.tolerance, held, made)
            if not why:
                return PlaceResult()
            raise HoldsNothing('{}, and {}'.format(err, why)) from err
        report('looking whether it stands there')
        arms_aside(self.context, [arm], {**boxes, 'placed': MapBox(stood, held.half, 0.0)})
        why = why_not_standing(
            robot.see(), stood, held.half, _without_table(boxes), self.hands.meant(arm)
        )
        if why:
            raise SkillError('the object was let go, but ' + why)
        return PlaceResult()

    def _why_not_placed(
        self, arm: str, centre: np.ndarray, tolerance: float, held: HeldObject, made: CollisionMap
    ) -> str:
        """Take an empty hand away from a place, and look whether it has put its object down there.

        :param made: a map of what stood there before.
        :returns: why it does not stand there, or ''.
        """
        robot = self.context.robot
        robot.look_at(centre)
        with Arm(self.context, arm, made.boxes, seed_of(arm, centre)) as hand:
            if np.hypot(*(hand.pose()[:2, 3] - centre[:2])) < ABOUT:
                draw_back(hand, RETREAT, hand.space.names(), SLOW)
        arms_aside(self.context, [arm], made.boxes)
        limbs = limbs_of(self._links, encoder_readings(robot))
        image, why = robot.see(), 'nothing stands at its place'
        for box in things_on_table(image, limbs):
            if (
                np.hypot(*(box.centre - centre)[:2]) >= (tolerance or USUAL_SPOT) + KNOWN
                or nearest_object(made, box.centre) is not None
            ):
                continue
            middle = box.centre + [0.0, 0.0, held.half[2] - box.size[2] / 2]
            why = why_not_standing(
                image, middle, held.half, _without_table(made.boxes), self.hands.meant(arm)
            )
            if not why and np.abs(box.size - 2 * held.half).max() >= SAME_SIZE:
                why = 'a thing of another size stands at its place'
            if not why:
                return ''
        return why

    def _standing_at(
        self,
        arm: str,
        centre: np.ndarray,
        tolerance: float,
        held: HeldObject,
        boxes: Mapping[str, MapBox],
    ) -> Dict[str, MapBox]:
        """Return the things about a place by now that are not on the map: boxes by name.

        :param boxes: the map.
        """
        robot = self.context.robot
        robot.look_at(centre)
        joints = encoder_readings(robot)
        hand = link_pose(self._links, BASE_FRAME, TOOL_FRAME[arm], joints) @ held.tool_from_object
        seen = things_on_table(robot.see(), limbs_of(self._links, joints))
        return {
            'thing {}'.format(k): MapBox(box.centre, box.size / 2 + PADDING, box.yaw)
            for k, box in enumerate(seen)
            if np.hypot(*(box.centre - centre)[:2]) < tolerance + ABOUT
            and np.hypot(*(box.centre - hand[:3, 3])[:2]) > ABOUT / 2
            and all(
                np.hypot(*(box.centre - other.centre)[:2]) > KNOWN
                for name, other in boxes.items()
                if name.startswith('object')
            )
        }

    @contextlib.contextmanager
    def telling_of_losses(self, arm: str) -> Iterator[None]:
        """Remember a loss on the way, and refuse to put down what was lost before.

        What a hand has dropped may stand where it fell, upside down. So no look decides about it.

        :raises ObjectLost: where the hand has lost its object, and holds nothing since.
        """
        if self.hands.has_lost(arm) and not may_hold(encoder_readings(self.context.robot), arm):
            raise ObjectLost('the {} hand holds nothing: it has lost its object'.format(arm))
        try:
            yield
        except HoldsNothing:
            raise
        except ObjectLost:
            self.hands.lose(arm)
            raise

    def forget_slips(self) -> None:
        """The next grip is as gentle as the first."""
        self._effort = FEEL_EFFORT

    @contextlib.contextmanager
    def firmer_after_slip(self, attempt: int = 0) -> Iterator[float]:
        """Yield how firmly to grip, N. Where it slips even so, the next grip is the firmest.

        :param attempt: how often it has been tried before. After the first time, the grip is firm.
        """
        try:
            yield FIRM if attempt else self._effort
        except (ObjectSlipped, ObjectLost):
            self._effort = FIRM
            raise

    @contextlib.contextmanager
    def _withdrawing(
        self, arm: str, boxes: Dict[str, MapBox], errors: Type[Exception] = SkillError
    ) -> Iterator[None]:
        """After a failure, take the empty hand out of the camera's view."""
        try:
            yield
        except errors:
            self.hands.feel(self.context.robot)
            try:
                arms_aside(self.context, [arm], boxes)
            except SkillError:
                pass  # the first failure is the one to report
            raise

    def _return_held(self, arms: Sequence[str], report: ReportStatus) -> None:
        """Put down what hands hold, where they are over the spot that it was taken from."""
        for arm in arms:
            held = self.hands.find(arm)
            joints = encoder_readings(self.context.robot)
            tool = link_pose(self._links, BASE_FRAME, TOOL_FRAME[arm], joints)
            if held is not None and np.hypot(*(tool - held.grasp)[:2, 3]) < NEAR:
                report('putting back what the {} hand holds'.format(arm))
                now = tool @ held.tool_from_object
                own = UprightBox(now[:3, 3], 2 * held.half, yaw_of(now))
                self._put_back(arm, self._seen(own).boxes)

    def _put_back(self, arm: str, boxes: Dict[str, MapBox]) -> None:
        """Put an object that the hand still holds straight down."""
        held = self.hands.find(arm)
        if held is not None:
            put_back(self.context, arm, held, boxes)

    def _held_object(
        self, arm: str, grasp: np.ndarray, made: CollisionMap
    ) -> Tuple[HeldObject, Dict[str, MapBox]]:
        """The held object, and the boxes without it.

        It is the one that the map has there, or the remembered one, or something of the usual size.
        """
        index = nearest_object(made, grasp[:3, 3], BESIDE_GRASP)
        boxes = dict(made.boxes)
        known = self.hands.find(arm)
        if known is not None and np.linalg.norm((known.grasp - grasp)[:3, 3]) >= SAME_GRASP:
            known = None
        if index is not None:
            box = made.objects[index]
            boxes.pop('object {}'.format(index))
            return HeldObject(
                grasp, inverse(grasp) @ box.matrix, box.size / 2, known.effort if known else FIRM
            ), boxes
        if known is not None:
            return known, boxes
        upright = UprightBox(grasp[:3, 3], 2 * USUAL, 0.0)
        return HeldObject(grasp, inverse(grasp) @ upright.matrix, USUAL, FIRM), boxes

    def _seen(self, target: Optional[UprightBox] = None) -> CollisionMap:
        """The map of what the camera sees now, with the table, where it sees one."""
        image = self.context.robot.see()
        limbs = limbs_of(self._links, encoder_readings(self.context.robot))
        seen = map_of_image(image, limbs, target)
        try:
            table = find_tabletop(image, limbs=limbs).table
        except NotSeen:
            return seen
        return seen._replace(boxes={**seen.boxes, **map_of(table, []).boxes})
