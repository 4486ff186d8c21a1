"""A sleep that ends as /clock jumps back is a failure of its state. rospy's shutdown is not."""

import pytest
import rospy

import smach
from smach_oracle.oracle import OracleContainer

ENDS = ['done', 'failed']


def raising(error):
    """A state that raises once."""
    errors = [error]

    def execute(userdata):
        if errors:
            raise errors.pop()
        return 'done'

    return smach.CBState(execute, outcomes=['done'])


def machine(state):
    sm = smach.StateMachine(list(ENDS))
    with sm:
        smach.StateMachine.add('WORK', state)
    return sm


def concurrence(state):
    both = smach.Concurrence(list(ENDS), 'failed', outcome_map={'done': {'WORK': 'done'}})
    with both:
        smach.Concurrence.add('WORK', state)
    return machine(both)


def iterator(state):
    items = smach.Iterator(list(ENDS), [], [], [1, 2], 'item', 'done')
    with items:
        smach.Iterator.set_contained_state('WORK', state, loop_outcomes=['done'])
    return machine(items)


@pytest.mark.parametrize('around', [machine, concurrence, iterator])
def test_a_clock_that_jumps_back_is_a_failure(around):
    state = raising(rospy.ROSTimeMovedBackwardsException(0.4))
    assert OracleContainer.wrap(around(state)).execute() == 'done'


def test_rospys_shutdown_ends_the_program():
    wrapped = OracleContainer.wrap(machine(raising(rospy.ROSInterruptException('shutdown'))))
    with pytest.raises((rospy.ROSInterruptException, smach.InvalidUserCodeError)):
        wrapped.execute()
