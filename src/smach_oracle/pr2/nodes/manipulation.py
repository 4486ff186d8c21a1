"""The manipulation skills over messages: goals in, results out. The node gives them servers."""
import contextlib
from typing import Dict, Iterator, Optional, Tuple, Type

import numpy as np

from smach_oracle.msg import (BuildCollisionMapGoal, BuildCollisionMapResult, MoveArmsAsideGoal, MoveArmsAsideResult,
                              PickGoal, PickResult, PlaceGoal, PlaceResult, PointHeadGoal, PointHeadResult)

from ...geometry import chain
from ...geometry.box import UprightBox
from ...geometry.transforms import inverse, yaw_of
from .arm import FEEL_EFFORT, Means, SkillError, read_joints, stands_open
from .arms_aside import arms_aside, is_aside
from .clusters import NotSeen
from .collision_map import CollisionMap, MapBook, around, map_of, map_of_frame, nearest_object
from .frames import box_in_base, point_in_base, pose_in_base, pose_message
from .interface import ARMS
from .kitchen import MapBox
from .own_limbs import limbs_of
from .pick import FIRM, Held, Slipped, pick
from .place import Lost, place, put_back, stands_there
from .skill_server import Say
from .tabletop import find_tabletop

TABLE_SIZE = np.array([1.4, 0.7, 0.0])  # m, of any table: a goal says only where its middle is, and its long side
SAME_GRASP = 0.02  # m between two poses of the tool that are taken for the same grasp
BESIDE_GRASP = 0.07  # m from the tool to the middle of what it grasped, at most
USUAL = np.array([0.03, 0.03, 0.06])  # m, half extents of a held thing that nothing is known of


class Manipulation:
    """Arms aside, head, collision map, pick and place, as answers to goals.

    A goal that cannot be reached, or makes no sense, ends in a SkillError, RobotError or PlanningError with the reason.
    """

    def __init__(self, means: Means) -> None:
        self.means = means
        self.maps = MapBook()
        self.held: Dict[str, Held] = {}
        self._effort = FEEL_EFFORT  # N, of the next grip
        self._links = chain.read_joints(means.model.urdf)

    def move_arms_aside(self, goal: MoveArmsAsideGoal, say: Say) -> MoveArmsAsideResult:
        """Both arms, or those named, to the robot's sides; what slipped before that is forgotten."""
        self.forget_slips()
        for arm in goal.arms:
            known_arm(arm)
        arms = list(goal.arms) or list(ARMS)
        joints = read_joints(self.means.robot)
        boxes: Dict[str, MapBox] = {}
        if not all(is_aside(joints, arm) for arm in arms):
            say('looking for what is in the way')
            boxes = self._seen().boxes
        arms_aside(self.means, arms, boxes)
        return MoveArmsAsideResult()

    def point_head(self, goal: PointHeadGoal, say: Say) -> PointHeadResult:
        """The camera's axis to a point."""
        point = point_in_base(goal.target, self.means.robot, 'target')
        say('moving the head')
        self.means.robot.look_at(point)
        return PointHeadResult()

    def build_collision_map(self, goal: BuildCollisionMapGoal, say: Say) -> BuildCollisionMapResult:
        """Boxes of the table and the objects, under an id.

        :raises SkillError: for a pose or size that is none, or another number of objects than of sizes.
        """
        robot = self.means.robot
        if len(goal.objects) != len(goal.sizes):
            raise SkillError('{} objects but {} sizes'.format(len(goal.objects), len(goal.sizes)))
        objects = [box_in_base(pose, size, robot, 'objects[{}]'.format(k))
                   for k, (pose, size) in enumerate(zip(goal.objects, goal.sizes))]
        centre = pose_in_base(goal.table, robot, 'table')
        made = map_of(UprightBox(centre[:3, 3], TABLE_SIZE, yaw_of(centre)), objects)
        return BuildCollisionMapResult(map_id=self.maps.keep(made), boxes=len(made.boxes))

    def pick(self, goal: PickGoal, say: Say) -> PickResult:
        """Grasp an object and lift it."""
        arm = known_arm(goal.arm)
        target = box_in_base(goal.object, goal.size, self.means.robot, 'object')
        made = self.maps.find(goal.map_id) if goal.map_id else self._seen(target)
        boxes = around(made, target)
        self._put_back(arm, boxes)
        say('choosing a grasp')
        with self._withdrawing(arm, boxes):
            with self.firmer_after_slip() as effort:
                self.held[arm] = pick(self.means, arm, target, boxes, effort)
        return PickResult(grasp=pose_message(self.held[arm].grasp))

    def place(self, goal: PlaceGoal, say: Say) -> PlaceResult:
        """Put down what is held, and look whether it stands there. Raises SkillError where it does not."""
        arm = known_arm(goal.arm)
        robot = self.means.robot
        centre = pose_in_base(goal.pose, robot, 'pose')[:3, 3]
        grasp = pose_in_base(goal.grasp, robot, 'grasp')
        made = self.maps.find(goal.map_id) if goal.map_id else self._seen()
        held, boxes = self._held_object(arm, grasp, made)
        say('choosing a way')
        with self._withdrawing(arm, boxes, Lost):
            stood = place(self.means, arm, centre, held, boxes)
        self.held.pop(arm, None)
        say('looking whether it stands there')
        boxes['placed'] = MapBox(stood, held.half, 0.0)
        arms_aside(self.means, [arm], boxes)
        if not stands_there(self.means.robot.see(), stood, held):
            raise SkillError('the object was let go, but nothing stands at its place')
        return PlaceResult()

    def forget_slips(self) -> None:
        """The next grip is as gentle as the first."""
        self._effort = FEEL_EFFORT

    @contextlib.contextmanager
    def firmer_after_slip(self) -> Iterator[float]:
        """How firmly to grip, N; where it slips all the same, the next grip is the firmest."""
        try:
            yield self._effort
        except Slipped:
            self._effort = FIRM
            raise

    @contextlib.contextmanager
    def _withdrawing(self, arm: str, boxes: Dict[str, MapBox], errors: Type[Exception] = SkillError) -> Iterator[None]:
        """After a failure the hand is empty, and the arm shall not stay where it hides what the camera should see."""
        try:
            yield
        except errors:
            self.held.pop(arm, None)
            try:
                arms_aside(self.means, [arm], boxes)
            except SkillError:
                pass  # what made the skill fail is what people should be told
            raise

    def _put_back(self, arm: str, boxes: Dict[str, MapBox]) -> None:
        """An object that the hand still holds goes straight down again; in a hand that stands open there is none.

        What was held may have been taken from the hand since then, or have been in another trial's world.
        """
        held = self.held.pop(arm, None)
        if held is not None and not stands_open(read_joints(self.means.robot), arm):
            put_back(self.means, arm, held, boxes)

    def _held_object(self, arm: str, grasp: np.ndarray, made: CollisionMap) -> Tuple[Held, Dict[str, MapBox]]:
        """What is held, and the boxes without it: by the map, by memory, or something of the usual size."""
        index = nearest_object(made, grasp[:3, 3], BESIDE_GRASP)
        boxes = dict(made.boxes)
        known = self.held.get(arm)
        if known is not None and np.linalg.norm((known.grasp - grasp)[:3, 3]) >= SAME_GRASP:
            known = None
        if index is not None:
            box = made.objects[index]
            boxes.pop('object {}'.format(index))
            return Held(grasp, inverse(grasp) @ box.matrix, box.size / 2, known.effort if known else FIRM), boxes
        if known is not None:
            return known, boxes
        upright = UprightBox(grasp[:3, 3], 2 * USUAL, 0.0)
        return Held(grasp, inverse(grasp) @ upright.matrix, USUAL, FIRM), boxes

    def _seen(self, target: Optional[UprightBox] = None) -> CollisionMap:
        """The map of what the camera sees now, with the table, where it sees one."""
        frame = self.means.robot.see()
        limbs = limbs_of(self._links, read_joints(self.means.robot))
        seen = map_of_frame(frame, limbs, target)
        try:
            table = find_tabletop(frame, limbs=limbs).table
        except NotSeen:
            return seen
        return seen._replace(boxes={**seen.boxes, **map_of(table, []).boxes})


def known_arm(arm: str) -> str:
    """The arm. Raises SkillError for an unknown one."""
    if arm not in ARMS:
        raise SkillError('unknown arm {!r}; allowed: {}'.format(arm, ', '.join(ARMS)))
    return arm
