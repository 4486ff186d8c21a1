"""What the use cases' scripts do otherwise when a state is executed again in the same trial."""

import pytest
from actionlib_msgs.msg import GoalStatus
from geometry_msgs.msg import Point, PointStamped, Pose, PoseStamped, Quaternion, Vector3
from move_base_msgs.msg import MoveBaseGoal
from std_msgs.msg import ColorRGBA, Header

import smach
from smach_oracle.msg import (
    DetectDrinkGoal,
    DetectDrinkResult,
    DetectTabletopGoal,
    DetectTabletopResult,
    PickGoal,
    PickResult,
    PointHeadGoal,
)
from smach_oracle.pr2.nodes.manipulation import elsewhere_of
from smach_oracle.ros.stored.ros_codecs import offer_ros_codecs
from smach_oracle.store.codecs import CODECS
from smach_oracle.tasks import drink_retrieval, pick_and_place
from smach_oracle.tasks.pick_and_place import VIEWS, detected


@pytest.fixture(name='userdata')
def _userdata():
    userdata = smach.UserData()
    pick_and_place.begin(userdata)
    drink_retrieval.begin(userdata)
    return userdata


def looked_at(userdata):
    target = pick_and_place.head_goal(userdata, PointHeadGoal()).target
    return (target.point.x, target.point.y, target.point.z)


def test_after_a_look_that_saw_too_little_the_head_looks_from_elsewhere(userdata):
    assert looked_at(userdata) == VIEWS[0] == looked_at(userdata)
    detected(userdata, GoalStatus.ABORTED, DetectTabletopResult())
    assert looked_at(userdata) == VIEWS[1]
    cut = PointStamped(Header(frame_id='base_footprint'), Point(0.5, 0.4, 0.7))
    detected(userdata, GoalStatus.ABORTED, DetectTabletopResult(look_at=cut))
    assert looked_at(userdata) == (0.5, 0.4, 0.7)
    detected(userdata, GoalStatus.ABORTED, None)  # the server has gone
    assert looked_at(userdata) == VIEWS[0]


def test_what_was_seen_first_is_the_object_until_the_trial_ends(userdata):
    def goal():
        return pick_and_place.detect_goal(userdata, DetectTabletopGoal())

    assert goal().colour.a == 0
    dark = DetectTabletopResult(objects=[PoseStamped()], sizes=[Vector3()], colours=[ColorRGBA()])
    detected(userdata, GoalStatus.SUCCEEDED, dark)
    assert goal().colour.a == 0, 'too dark to tell'
    for red in (0.8, 0.1):
        result = DetectTabletopResult(
            objects=[PoseStamped()],
            sizes=[Vector3(red, 0.1, 0.1)],
            colours=[ColorRGBA(red, 0.2, 0.2, 1.0)],
        )
        detected(userdata, GoalStatus.SUCCEEDED, result)
        assert (goal().colour.r, goal().size.x) == (0.8, 0.8)
    pick_and_place.begin(userdata)
    assert goal().colour.r == 0.8, 'a trial that goes on after a crash has its memory'


def test_nearest_is_nearest_to_where_the_trial_began(userdata):
    near = pick_and_place.detect_goal(userdata, DetectTabletopGoal()).nearest_to
    assert (near.header.frame_id, near.point) == ('odom_combined', Point())


@pytest.mark.parametrize('y, reached', [(-0.3, True), (0.2, True), (0.4, False)])
def test_what_stands_far_to_the_left_is_out_of_reach(userdata, y, reached):
    userdata.objects = [PoseStamped(pose=Pose(Point(0.55, y, 0.8), Quaternion()))]
    assert pick_and_place.object_in_reach(userdata) is reached


def test_each_pick_of_a_trial_says_how_many_there_were_before(userdata):
    userdata.objects, userdata.sizes, userdata.map_id = [PoseStamped()], [Vector3()], 'map'
    assert [pick_and_place.pick_goal(userdata, PickGoal()).attempt for _ in range(3)] == [0, 1, 2]


def test_what_was_picked_and_could_not_be_placed_is_held_otherwise_at_once(userdata):
    userdata.objects, userdata.sizes, userdata.map_id = [PoseStamped()], [Vector3()], 'map'
    assert pick_and_place.pick_goal(userdata, PickGoal()).attempt == 0
    pick_and_place.picked(userdata, GoalStatus.ABORTED, PickResult())
    assert pick_and_place.pick_goal(userdata, PickGoal()).attempt == 1
    pick_and_place.picked(userdata, GoalStatus.SUCCEEDED, PickResult())
    attempt = pick_and_place.pick_goal(userdata, PickGoal()).attempt
    assert elsewhere_of(attempt) == 1, 'from above, however many picks have failed before'


def test_a_look_that_failed_empties_nothing_that_was_seen(userdata):
    seen = DetectTabletopResult(
        table=PoseStamped(), objects=[PoseStamped()], sizes=[Vector3()], colours=[ColorRGBA()]
    )
    detected(userdata, GoalStatus.SUCCEEDED, seen)
    detected(userdata, GoalStatus.ABORTED, DetectTabletopResult())
    assert (userdata.objects, userdata.sizes) == (seen.objects, seen.sizes)
    state = pick_and_place.make_machine().get_children()['DETECT_TABLETOP']
    assert {'table', 'objects', 'sizes', 'memory'} <= set(state.get_registered_output_keys())


def test_the_ordered_drink_is_looked_for_from_elsewhere_each_time_and_gripped_firmer(userdata):
    for missed in range(3):
        goal = drink_retrieval.detect_goal(userdata, DetectDrinkGoal())
        assert (goal.colour, goal.view) == (drink_retrieval.ORDERED, missed)
        drink_retrieval.detected(userdata, GoalStatus.ABORTED, DetectDrinkResult())
    drink_retrieval.detected(userdata, GoalStatus.SUCCEEDED, DetectDrinkResult())
    assert drink_retrieval.detect_goal(userdata, DetectDrinkGoal()).view == 3, 'that one showed it'
    userdata.drink, userdata.size = PoseStamped(), Vector3()
    assert [drink_retrieval.pick_goal(userdata, PickGoal()).attempt for _ in range(2)] == [0, 1]
    drink_retrieval.begin(userdata)
    assert userdata.picks == 2, 'a trial that goes on after a crash has its memory'


def test_the_shelf_is_looked_at_from_another_place_after_two_misses(userdata):
    def place():
        target = drink_retrieval.move_in_goal(userdata, MoveBaseGoal()).target_pose
        assert target.header.frame_id == drink_retrieval.ODOM
        return target.pose.position.x, target.pose.position.y

    usual, beside = drink_retrieval.IN_THE_FRIDGE[:2], drink_retrieval.BESIDE_THE_DOOR[:2]
    for expected in (usual, usual, beside, usual):
        assert place() == expected == place()
        drink_retrieval.detected(userdata, GoalStatus.ABORTED, DetectDrinkResult())


def test_what_a_trial_remembers_can_be_stored(userdata):
    detected(
        userdata,
        GoalStatus.SUCCEEDED,
        DetectTabletopResult(
            objects=[PoseStamped()],
            sizes=[Vector3(0.125, 0.125, 0.125)],
            colours=[ColorRGBA(0.75, 0.25, 0.25, 1.0)],
        ),
    )
    detected(userdata, GoalStatus.ABORTED, DetectTabletopResult(look_at=PointStamped()))
    offer_ros_codecs()
    text, whole, parts = CODECS.encode(userdata.memory)
    assert CODECS.decode(text, whole, parts.__getitem__) == userdata.memory
