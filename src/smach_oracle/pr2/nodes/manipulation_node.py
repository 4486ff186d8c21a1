"""Node: what the PR2's arms, hands and head can do, as actions."""

import rospy

from smach_oracle.msg import (
    BuildCollisionMapAction,
    CloseDoorAction,
    HandOverAction,
    LocaliseAtFridgeAction,
    MoveArmsAsideAction,
    OpenDoorAction,
    PickAction,
    PlaceAction,
    PointHeadAction,
)
from smach_oracle.ros.command_line import parameters_only

from ..model.pr2_model import ModelError
from ..planning.arm import SkillContext
from ..planning.collision import CollisionModel, installed_model, model_from
from ..ros_robot import RosRobot
from .collision_map_publisher import CollisionMapPublisher
from .kitchen_skills import KitchenSkills
from .perception_node import await_robot, kitchen_at, pass_time_service, snapshot_service
from .skill_server import SkillServer


def robot_model() -> CollisionModel:
    """The model on the parameter server, if its semantics are there too, else the installed PR2."""
    urdf = rospy.get_param('robot_description', '')
    srdf = rospy.get_param('robot_description_semantic', '')
    return model_from(urdf.replace('file://', ''), srdf) if urdf and srdf else installed_model()


def serve(skills: KitchenSkills, server: SkillServer) -> None:
    """Offer all skills."""
    server.offer('move_arms_aside', MoveArmsAsideAction, skills.move_arms_aside)
    server.offer('point_head', PointHeadAction, skills.point_head)
    server.offer(
        'build_collision_map',
        BuildCollisionMapAction,
        CollisionMapPublisher(skills.build_collision_map, skills.maps),
    )
    server.offer('pick', PickAction, skills.pick)
    server.offer('place', PlaceAction, skills.place)
    server.offer('localise_at_fridge', LocaliseAtFridgeAction, skills.localise_at_fridge)
    server.offer('open_door', OpenDoorAction, skills.open_door)
    server.offer('close_door', CloseDoorAction, skills.close_door)
    server.offer('hand_over', HandOverAction, skills.hand_over)


def main() -> None:
    """Entry point of the node."""
    parameters_only(
        'Node: move_arms_aside, point_head, build_collision_map, pick, place, localise_at_fridge, '
        'open_door, close_door and hand_over as actions. Parameters: ~snapshot, ~pass_time, '
        '~kitchen; see doc/simulation.md.'
    )
    rospy.init_node('pr2_manipulation')
    try:
        kitchen = kitchen_at('~kitchen')
        robot = RosRobot(snapshot=snapshot_service(), pass_time=pass_time_service())
        model = robot_model()
    except (ValueError, ModelError) as err:
        rospy.logfatal('pr2_manipulation: %s', err)
        raise SystemExit(2) from err
    await_robot(robot)
    server = SkillServer(robot.abort, robot.resume)
    serve(KitchenSkills(SkillContext(robot, model), kitchen), server)
    rospy.loginfo('pr2_manipulation: %d actions ready', server.names())
    rospy.spin()
