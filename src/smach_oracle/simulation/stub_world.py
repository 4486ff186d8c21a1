"""A node of real action servers for the pick and place task, whose failures come from a seeded fault model.

It moves nothing: it shows what the executive, the recorder and the statistics make of failures. The task knows only
its actions, so that a simulated or a real robot can take its place.
"""
import json
from typing import Any, Callable, Dict, List, Optional, Tuple

import actionlib
import rospy
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, Vector3
from std_msgs.msg import Header

from smach_oracle.msg import (BuildCollisionMapAction, BuildCollisionMapGoal, BuildCollisionMapResult,
                              DetectTabletopAction, DetectTabletopGoal, DetectTabletopResult, MoveArmsAsideAction,
                              MoveArmsAsideGoal, MoveArmsAsideResult, PickAction, PickGoal, PickResult, PlaceAction,
                              PlaceGoal, PlaceResult, PointHeadAction, PointHeadGoal, PointHeadResult,
                              SharedAutonomyAction, SharedAutonomyGoal, SharedAutonomyResult, TrialCause)
from smach_oracle.oracle.errors import ConfigError
from smach_oracle.ros.command_line import parameters_only
from smach_oracle.ros.userdata_codec import encode
from smach_oracle.simulation.fault_model import CHAIN, Fault, FaultSettings, FaultyWorld, draw_faults
from smach_oracle.srv import ResetWorld, ResetWorldRequest, ResetWorldResponse

BASE = 'base_link'
ARMS = ('left', 'right')


def pose(x: float, y: float, z: float) -> PoseStamped:
    """An upright pose (m, in the robot's base frame), stamped now."""
    return PoseStamped(Header(frame_id=BASE, stamp=rospy.get_rostime()),
                       Pose(Point(x, y, z), Quaternion(0.0, 0.0, 0.0, 1.0)))


def known_arm(arm: str) -> str:
    """Why this is no arm of ours, or ''."""
    return '' if arm in ARMS else 'unknown arm {!r}; allowed: {}'.format(arm, ', '.join(ARMS))


def arms_aside(goal: MoveArmsAsideGoal) -> Tuple[str, MoveArmsAsideResult]:
    return next(filter(None, map(known_arm, goal.arms)), ''), MoveArmsAsideResult()


def head_pointed(goal: PointHeadGoal) -> Tuple[str, PointHeadResult]:
    point = goal.target.point
    finite = all(abs(value) < float('inf') for value in (point.x, point.y, point.z))
    return '' if finite else 'target is not a finite point', PointHeadResult()


def tabletop(goal: DetectTabletopGoal) -> Tuple[str, DetectTabletopResult]:
    result = DetectTabletopResult(table=pose(0.65, 0.0, 0.7), objects=[pose(0.6, -0.1, 0.76), pose(0.7, 0.2, 0.76)],
                                  sizes=[Vector3(0.06, 0.06, 0.12), Vector3(0.08, 0.05, 0.1)])
    return '', result


def collision_map(goal: BuildCollisionMapGoal) -> Tuple[str, BuildCollisionMapResult]:
    if len(goal.objects) != len(goal.sizes):
        return '{} objects but {} sizes'.format(len(goal.objects), len(goal.sizes)), BuildCollisionMapResult()
    return '', BuildCollisionMapResult(map_id='tabletop', boxes=1 + len(goal.objects))


def picked(goal: PickGoal) -> Tuple[str, PickResult]:
    if not goal.map_id:
        return 'no collision map named', PickResult()
    return known_arm(goal.arm), PickResult(grasp=goal.object)


def placed(goal: PlaceGoal) -> Tuple[str, PlaceResult]:
    return known_arm(goal.arm), PlaceResult()


# The task's states, the actions that do their work, and what these answer: (why the goal is bad or '', result).
ACTIONS: Dict[str, Tuple[str, type, Callable[[Any], Tuple[str, Any]]]] = {
    'MOVE_ARMS_ASIDE': ('move_arms_aside', MoveArmsAsideAction, arms_aside),
    'POINT_HEAD': ('point_head', PointHeadAction, head_pointed),
    'DETECT_TABLETOP': ('detect_tabletop', DetectTabletopAction, tabletop),
    'BUILD_COLLISION_MAP': ('build_collision_map', BuildCollisionMapAction, collision_map),
    'PICK': ('pick', PickAction, picked),
    'PLACE': ('place', PlaceAction, placed),
}


class StubWorld:
    """The six action servers, the reset service, the expert's hand and the hidden cause.

    Parameters: ``~action_time_s`` (s each action takes, default 0), ``~faults`` (dictionary, see `FaultSettings`).

    :raises ConfigError: naming the parameter, its value and what is allowed.
    """

    def __init__(self) -> None:
        self._action_time_s = _seconds('~action_time_s')
        self._settings = FaultSettings(rospy.get_param('~faults', {}))
        self._world = FaultyWorld()
        self._seed: Optional[int] = None
        self._placed = False
        self._truth_file = rospy.get_param('~truth_file', 'none')
        rospy.on_shutdown(self._tell_truth)
        self._cause = rospy.Publisher('world/cause', TrialCause, queue_size=10, latch=True)
        self._servers = [self._serve(state) for state in CHAIN]
        self._hand = actionlib.SimpleActionServer('world/assist', SharedAutonomyAction, self._assist, auto_start=False)
        self._hand.start()
        self._reset_service = rospy.Service('world/reset', ResetWorld, self._reset)

    def _serve(self, state: str) -> actionlib.SimpleActionServer:
        name, spec, answer = ACTIONS[state]
        server = actionlib.SimpleActionServer(
            name, spec, lambda goal: self._act(state, server, answer, goal), auto_start=False)
        server.start()
        return server

    def _reset(self, request: ResetWorldRequest) -> ResetWorldResponse:
        self._tell_truth()
        self._seed, self._placed = request.seed, False
        faults = draw_faults(request.seed, self._settings)
        self._world = FaultyWorld(faults)
        self._cause.publish(cause_of(request.seed, faults))
        return ResetWorldResponse(ok=True)

    def _tell_truth(self) -> None:
        if self._seed is not None and self._truth_file != 'none':
            with open(self._truth_file, 'a', encoding='utf-8') as file:
                file.write(json.dumps({'seed': self._seed, 'task': 'pick_and_place', 'success': self._placed, 'why': '',
                                       'causes': [], 'sim_s': 0.0, 'wall_s': 0.0, 'share': {}}) + '\n')

    def _act(self, state: str, server: actionlib.SimpleActionServer,
             answer: Callable[[Any], Tuple[str, Any]], goal: Any) -> None:
        world = self._world
        reason, result = answer(goal)
        if self._preempted(server):
            server.set_preempted(result)
            return
        result.reason = reason or world.attempt(state)
        if result.reason:
            server.set_aborted(result, result.reason)
        else:
            self._placed = self._placed or state == 'PLACE'
            server.set_succeeded(result)

    def _preempted(self, server: actionlib.SimpleActionServer) -> bool:
        """Spend the action's time; tell whether the goal was cancelled meanwhile."""
        end = rospy.get_time() + self._action_time_s
        while rospy.get_time() < end and not server.is_preempt_requested() and not rospy.is_shutdown():
            rospy.sleep(min(0.02, self._action_time_s))
        return bool(server.is_preempt_requested())

    def _assist(self, goal: SharedAutonomyGoal) -> None:
        """The expert's hand: the state's work is done, and its outputs are those of its own action."""
        if goal.state not in ACTIONS:
            text = 'no such work: {!r}; allowed: {}'.format(goal.state, ', '.join(ACTIONS))
            self._hand.set_aborted(SharedAutonomyResult(text=text), text)
            return
        self._world.assist(goal.state)
        self._placed = self._placed or goal.state == 'PLACE'
        outputs = assisted_outputs(goal.state)
        items = [encode(key, outputs[key]) for key in goal.output_keys if key in outputs]
        self._hand.set_succeeded(SharedAutonomyResult(outcome='succeeded', outputs=items, text='done by hand'))


def assisted_outputs(state: str) -> Dict[str, Any]:
    """What the expert's hand gives for a state: the result fields of a success."""
    _, spec, answer = ACTIONS[state]
    goal = spec().action_goal.goal
    if state == 'PICK':
        goal.arm, goal.map_id, goal.object = 'right', 'by hand', pose(0.6, -0.1, 0.76)
    result = answer(goal)[1]
    return {name: getattr(result, name) for name in result.__slots__ if name != 'reason'}


def cause_of(seed: int, faults: List[Fault]) -> TrialCause:
    """The hidden cause as a message."""
    return TrialCause(header=Header(stamp=rospy.get_rostime()), seed=seed, task='pick_and_place',
                      kinds=['fault_of_{}'.format(fault.state.lower()) for fault in faults],
                      details=['cured by {}, strength {}'.format(fault.cure, fault.strength) for fault in faults])


def _seconds(parameter: str) -> float:
    value = rospy.get_param(parameter, 0.0)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 <= value < float('inf'):
        raise ConfigError(rospy.resolve_name(parameter), value, 'a time of 0 s or more')
    return float(value)


def main() -> None:
    """Entry point of the node."""
    parameters_only('Node: action servers for the pick and place task, failing as a seed says. '
                    'Parameters: ~action_time_s, ~faults; see doc/use_cases.md.')
    rospy.init_node('stub_world')
    try:
        world = StubWorld()
    except ConfigError as err:
        rospy.logfatal('stub_world: %s', err)
        raise SystemExit(2) from err
    rospy.loginfo('stub_world: %d actions ready', len(world._servers))
    rospy.spin()
