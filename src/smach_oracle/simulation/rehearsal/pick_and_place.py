"""The first use case in one process, without ROS nodes: for tuning scenes, and for tests.

The steps are those of tasks/pick_and_place.py, done by the same code as behind the actions. When a
state is done again, it is done otherwise, as there.
"""

import time
from typing import Any, Callable, Dict, List, NamedTuple, Optional, Protocol, Tuple

from geometry_msgs.msg import Point, PointStamped, Pose, PoseStamped, Quaternion, Vector3
from std_msgs.msg import ColorRGBA, Header

from smach_oracle.geometry.joints import read_joints
from smach_oracle.msg import (
    BuildCollisionMapGoal,
    DetectTabletopGoal,
    MoveArmsAsideGoal,
    PickGoal,
    PlaceGoal,
    PointHeadGoal,
)
from smach_oracle.pr2.kitchen import Kitchen
from smach_oracle.pr2.nodes.manipulation import Manipulation
from smach_oracle.pr2.nodes.perception_node import Perception
from smach_oracle.pr2.nodes.skill_server import PartResultError
from smach_oracle.pr2.perception.clusters import NotSeen
from smach_oracle.pr2.planning.arm import SkillContext, SkillError
from smach_oracle.pr2.planning.collision import installed_model
from smach_oracle.pr2.planning.planner import PlanningError
from smach_oracle.pr2.robot import ODOM_FRAME, RobotError

from ..physics.judge import judge
from ..physics.world import World
from ..scenes.scene import Scene
from .direct_robot import DirectRobot, no_report

# m in ODOM_FRAME, what the head is pointed at, in turn after each look that showed too little
VIEWS = ((0.65, 0.0, 0.801), (0.85, 0.0, 0.801), (0.50, 0.0, 0.801))
PLACE = PoseStamped(
    Header(frame_id=ODOM_FRAME), Pose(Point(0.6, -0.35, 0.851), Quaternion(0.0, 0.0, 0.0, 1.0))
)
FROM_ABOVE = 2  # the attempt at which the hand comes from above
MIN_HEIGHT, TOLERANCE = 0.02, 0.045  # m
FAILURES = (SkillError, RobotError, PlanningError, NotSeen)


class RehearsalResult(NamedTuple):
    """The result of a trial."""

    seed: int
    failed: str  # the state that failed, '' for none
    reason: str
    success: bool  # in truth
    why: str
    causes: Tuple[str, ...]
    wall_s: Dict[str, float]  # by state
    sim_s: float


class Rehearsal(Protocol):
    """A task over one world."""

    @property
    def states(self) -> List[Tuple[str, Callable[[], None]]]:
        """Names, in order, and what is done in them."""

    def begin(self) -> None:
        """The script starts over: it remembers nothing. The robot goes on as it is."""


class PickAndPlaceRehearsal:
    """The states of the task over one world."""

    def __init__(self, world: World) -> None:
        self.robot = DirectRobot(world)
        self.skills = Manipulation(SkillContext(self.robot, installed_model()))
        self.eyes = Perception(self.robot, read_joints(self.skills.context.model.urdf), Kitchen())
        self.states: List[Tuple[str, Callable[[], None]]] = [
            (
                'MOVE_ARMS_ASIDE',
                lambda: self.skills.move_arms_aside(MoveArmsAsideGoal(), no_report),
            ),
            ('POINT_HEAD', self._point),
            ('DETECT_TABLETOP', self._detect),
            ('BUILD_COLLISION_MAP', self._map),
            ('PICK', self._pick),
            ('PLACE', self._place),
        ]
        self.begin()

    def begin(self) -> None:
        """See Rehearsal."""
        self.data: Dict[str, Any] = {}
        self.missed = self.picks = 0  # looks that did not show the object, and picks
        self.look_at: Optional[PointStamped] = None  # where the last look said there is more
        self.colour, self.size = ColorRGBA(), Vector3()  # of the object when it was first seen

    def head_goal(self) -> PointHeadGoal:
        """Return the goal of the state POINT_HEAD."""
        view = VIEWS[self.missed % len(VIEWS)]
        return PointHeadGoal(
            self.look_at or PointStamped(Header(frame_id=ODOM_FRAME), Point(*view))
        )

    def detect_goal(self) -> DetectTabletopGoal:
        """Return the goal of the state DETECT_TABLETOP."""
        return DetectTabletopGoal(
            MIN_HEIGHT, self.colour, self.size, PointStamped(header=Header(frame_id=ODOM_FRAME))
        )

    def _point(self) -> None:
        self.skills.point_head(self.head_goal(), no_report)

    def _detect(self) -> None:
        try:
            found = self.eyes.detect_tabletop(self.detect_goal(), no_report)
        except FAILURES as err:
            self.missed += 1
            where = err.fields.get('look_at') if isinstance(err, PartResultError) else None
            self.look_at = where if isinstance(where, PointStamped) else None
            raise
        self.data.update(table=found.table, objects=found.objects, sizes=found.sizes)
        if not self.colour.a:
            self.colour, self.size = found.colours[0], found.sizes[0]

    def _map(self) -> None:
        goal = BuildCollisionMapGoal(self.data['table'], self.data['objects'], self.data['sizes'])
        self.data['map_id'] = self.skills.build_collision_map(goal, no_report).map_id

    def pick_goal(self) -> PickGoal:
        """Return the goal of the state PICK."""
        self.picks += 1
        return PickGoal(
            'right',
            self.data['objects'][0],
            self.data['sizes'][0],
            self.data['map_id'],
            min(self.picks - 1, 255),
        )

    def _pick(self) -> None:
        self.data['grasp'] = self.skills.pick(self.pick_goal(), no_report).grasp
        self.picks = max(self.picks, FROM_ABOVE)

    def _place(self) -> None:
        goal = PlaceGoal('right', PLACE, self.data['grasp'], self.data['map_id'], TOLERANCE)
        self.skills.place(goal, no_report)


def rehearse(
    scene: Scene,
    world: Optional[World] = None,
    task: Callable[[World], Rehearsal] = PickAndPlaceRehearsal,
) -> RehearsalResult:
    """One trial up to its first failure, in a world of its own, where none is given."""
    if world is None:
        world = World()
        try:
            return rehearse(scene, world, task)
        finally:
            world.close()
    begun = time.perf_counter()
    world.reset(scene)
    trial = task(world)
    wall = {'reset': time.perf_counter() - begun}
    start = world.time
    failed = reason = ''
    for name, work in trial.states:
        begun = time.perf_counter()
        try:
            work()
        except FAILURES as err:
            failed, reason = name, str(err)
        wall[name] = time.perf_counter() - begun
        if failed:
            break
    elapsed = world.time - start
    world.step(60)
    verdict = judge(world, scene.goal)
    return RehearsalResult(
        scene.seed,
        failed,
        reason,
        verdict.success,
        verdict.why,
        tuple(cause.kind for cause in scene.causes),
        wall,
        elapsed,
    )
