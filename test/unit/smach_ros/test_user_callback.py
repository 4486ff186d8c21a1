"""User callbacks of action, service and monitor states."""

import pytest

import smach

pytest.importorskip('rospy')
pytest.importorskip('smach_ros.user_callback')
from smach_ros.user_callback import UserCallback, checked_slots


def test_callback_sees_the_states_keys_or_its_own():
    data = smach.UserData()
    data.a, data.b = 1, 2
    plain = UserCallback('cb', lambda ud, value, more: ud.a + value + more, [10], None, ['a'], [])
    assert plain(data, 100) == 111
    own = UserCallback(
        'cb', smach.cb_interface(input_keys=['b'])(lambda ud: ud.b), [], None, ['a'], []
    )
    assert own(data) == 2
    with pytest.raises(smach.InvalidUserCodeError):
        UserCallback('cb', lambda ud: ud.b, [], None, ['a'], [])(data)


@pytest.mark.parametrize('decides, outcomes', [(True, ('far',)), (False, ())])
def test_a_callback_brings_its_keys_and_its_outcomes_only_where_it_decides_the_end(
    decides, outcomes
):
    state = smach.State()
    cb = smach.cb_interface(outcomes=['far'], input_keys=['i'], output_keys=['o'])(lambda ud: 'far')
    UserCallback('cb', cb, [], None, [], []).register_with(state, decides=decides)
    assert (
        state.get_registered_outcomes(),
        state.get_registered_input_keys(),
        state.get_registered_output_keys(),
    ) == (outcomes, ('i',), ('o',))


def test_unknown_slot_is_named_with_those_there_are():
    from std_msgs.msg import Header

    assert checked_slots('goal_slots', ['stamp'], Header()) == ('stamp',)
    with pytest.raises(
        smach.InvalidStateError, match=r"goal_slots \['time'\].*std_msgs/Header.*stamp"
    ):
        checked_slots('goal_slots', ['stamp', 'time'], Header())
