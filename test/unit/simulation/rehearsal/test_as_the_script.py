"""A rehearsal tries as the script's states do, when one is tried again and when it starts over."""

import pytest
from actionlib_msgs.msg import GoalStatus
from geometry_msgs.msg import Point, PointStamped, PoseStamped, Vector3
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
from smach_oracle.pr2.nodes.skill_server import PartResultError
from smach_oracle.pr2.perception.clusters import NotSeen
from smach_oracle.simulation.physics.world import World
from smach_oracle.simulation.rehearsal.drink_retrieval import DrinkRetrievalRehearsal
from smach_oracle.simulation.rehearsal.pick_and_place import PickAndPlaceRehearsal
from smach_oracle.tasks import drink_retrieval, pick_and_place

CUT_OFF = PointStamped(Header(frame_id='odom_combined'), Point(0.5, 0.4, 0.8))
SEEN = {
    'objects': [PoseStamped()],
    'sizes': [Vector3(0.06, 0.06, 0.12)],
    'colours': [ColorRGBA(0.8, 0.1, 0.1, 1.0)],
}


class Answers:
    """Stands for perception and manipulation: answers or fails as it is told."""

    def __init__(self, *answers):
        self.left, self.goals = list(answers), []

    def __call__(self, goal, report):
        self.goals.append(goal)
        answer = self.left.pop(0)
        if isinstance(answer, Exception):
            raise answer
        return answer


@pytest.fixture(name='world', scope='module')
def _world():
    one = World()
    yield one
    one.close()


@pytest.fixture(name='userdata')
def _userdata():
    userdata = smach.UserData()
    userdata.map_id = 'map'
    return userdata


def tried(work):
    """Do a state; whether it succeeded."""
    try:
        work()
    except (NotSeen, PartResultError):
        return False
    return True


@pytest.mark.parametrize('begins', [1, 2])
def test_at_the_table_looks_and_picks_vary_as_the_scripts_do(world, userdata, begins):
    trial = PickAndPlaceRehearsal(world)
    for _ in range(begins):
        trial.begin()
        userdata = smach.UserData()
        userdata.map_id = trial.data['map_id'] = 'map'
        pick_and_place.begin(userdata)
        seen = DetectTabletopResult(table=PoseStamped(), **SEEN)
        cut = PartResultError('cut off', {'look_at': CUT_OFF})
        looks = Answers(NotSeen('no'), cut, NotSeen('no'), NotSeen('no'), seen, NotSeen('no'))
        trial.eyes.detect_tabletop = looks
        for each in list(looks.left):
            assert trial.head_goal() == pick_and_place.head_goal(userdata, PointHeadGoal())
            wanted = pick_and_place.detect_goal(userdata, DetectTabletopGoal())
            well = tried(trial.states[2][1])
            assert looks.goals[-1] == wanted
            result = (
                seen
                if well
                else DetectTabletopResult(look_at=CUT_OFF if each is cut else PointStamped())
            )
            pick_and_place.detected(
                userdata, GoalStatus.SUCCEEDED if well else GoalStatus.ABORTED, result
            )
        trial.skills.pick = Answers(NotSeen('no'), PickResult(), PickResult(), NotSeen('no'))
        for _ in range(4):
            wanted = pick_and_place.pick_goal(userdata, PickGoal())
            well = tried(trial.states[4][1])
            assert trial.skills.pick.goals[-1] == wanted
            pick_and_place.picked(
                userdata, GoalStatus.SUCCEEDED if well else GoalStatus.ABORTED, PickResult()
            )
    pose, place = trial_place(trial), pick_and_place.place_pose()
    assert pose == place


def trial_place(trial):
    """Where a rehearsal puts its object down."""
    trial.data['grasp'] = PoseStamped()
    trial.skills.place = Answers(None)
    trial.states[5][1]()
    goal = trial.skills.place.goals[0]
    assert goal.tolerance == pick_and_place.PLACE_TOLERANCE
    return goal.pose


def test_in_the_kitchen_looks_places_and_picks_vary_as_the_scripts_do(world):
    trial = DrinkRetrievalRehearsal(world)
    for _ in range(2):
        trial.begin()
        userdata = smach.UserData()
        userdata.drink, userdata.size = PoseStamped(), Vector3()
        drink_retrieval.begin(userdata)
        looks = Answers(NotSeen('no'), NotSeen('no'), NotSeen('no'), DetectDrinkResult())
        trial.eyes.detect_drink = looks
        for _ in range(4):
            driven = drink_retrieval.move_in_goal(userdata, MoveBaseGoal()).target_pose
            assert drink_retrieval.pose_on_floor(*trial.looks_from()) == driven
            wanted = drink_retrieval.detect_goal(userdata, DetectDrinkGoal())
            well = tried(trial.states[4][1])
            assert looks.goals[-1] == wanted
            drink_retrieval.detected(
                userdata, GoalStatus.SUCCEEDED if well else GoalStatus.ABORTED, None
            )
        for _ in range(3):
            assert trial.pick_goal() == drink_retrieval.pick_goal(userdata, PickGoal())
