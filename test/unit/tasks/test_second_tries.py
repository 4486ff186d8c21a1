"""What the use cases' scripts do otherwise when a state is executed again in the same trial."""
import pytest
from actionlib_msgs.msg import GoalStatus
from geometry_msgs.msg import Point, PointStamped, PoseStamped, Vector3
from std_msgs.msg import ColorRGBA, Header

import smach
from smach_oracle.msg import (
    DetectDrinkGoal,
    DetectDrinkResult,
    DetectTabletopGoal,
    DetectTabletopResult,
    PickGoal,
    PointHeadGoal,
)
from smach_oracle.tasks import drink_retrieval
from smach_oracle.tasks.pick_and_place import VIEWS, TableMemory


@pytest.fixture(name='memory')
def _memory():
    return TableMemory()


def looked_at(memory):
    target = memory.head_goal(smach.UserData(), PointHeadGoal()).target
    return (target.point.x, target.point.y, target.point.z)


def test_after_a_look_that_saw_too_little_the_head_looks_from_elsewhere(memory):
    assert looked_at(memory) == VIEWS[0] == looked_at(memory)
    memory.detected(smach.UserData(), GoalStatus.ABORTED, DetectTabletopResult())
    assert looked_at(memory) == VIEWS[1]
    cut = PointStamped(Header(frame_id='base_footprint'), Point(0.5, 0.4, 0.7))
    memory.detected(smach.UserData(), GoalStatus.ABORTED, DetectTabletopResult(look_at=cut))
    assert looked_at(memory) == (0.5, 0.4, 0.7)
    memory.detected(smach.UserData(), GoalStatus.ABORTED, None)  # the server has gone
    assert looked_at(memory) == VIEWS[0]


def test_what_was_seen_first_is_the_object_until_the_trial_ends(memory):
    def goal():
        return memory.detect_goal(smach.UserData(), DetectTabletopGoal())
    assert goal().colour.a == 0
    dark = DetectTabletopResult(objects=[PoseStamped()], sizes=[Vector3()], colours=[ColorRGBA()])
    memory.detected(smach.UserData(), GoalStatus.SUCCEEDED, dark)
    assert goal().colour.a == 0, 'too dark to tell'
    for red in (0.8, 0.1):
        result = DetectTabletopResult(objects=[PoseStamped()], sizes=[Vector3(red, 0.1, 0.1)],
                                      colours=[ColorRGBA(red, 0.2, 0.2, 1.0)])
        memory.detected(smach.UserData(), GoalStatus.SUCCEEDED, result)
        assert (goal().colour.r, goal().size.x) == (0.8, 0.8)
    memory.begin()
    assert goal().colour.a == 0


def test_each_pick_of_a_trial_says_how_many_there_were_before(memory):
    userdata = smach.UserData()
    userdata.objects, userdata.sizes, userdata.map_id = [PoseStamped()], [Vector3()], 'map'
    assert [memory.pick_goal(userdata, PickGoal()).attempt for _ in range(3)] == [0, 1, 2]


def test_the_ordered_drink_is_looked_for_from_elsewhere_each_time_and_gripped_firmer():
    memory, userdata = drink_retrieval.DrinkMemory(), smach.UserData()
    for missed in range(3):
        goal = memory.detect_goal(userdata, DetectDrinkGoal())
        assert (goal.colour, goal.view) == (drink_retrieval.ORDERED, missed)
        memory.detected(userdata, GoalStatus.ABORTED, DetectDrinkResult())
    memory.detected(userdata, GoalStatus.SUCCEEDED, DetectDrinkResult())
    assert memory.detect_goal(userdata, DetectDrinkGoal()).view == 3, 'that one showed it'
    userdata.drink, userdata.size = PoseStamped(), Vector3()
    assert [memory.pick_goal(userdata, PickGoal()).attempt for _ in range(2)] == [0, 1]
    memory.begin()
    assert memory.detect_goal(userdata, DetectDrinkGoal()).view == 0
