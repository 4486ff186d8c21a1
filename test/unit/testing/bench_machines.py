"""Machines of every kind of container, whose states all succeed."""

import smach

OUTCOMES = ('succeeded', 'aborted', 'preempted')


class Works(smach.State):
    """Succeeds, and counts how often it did its work.

    It heeds no preempt. After an exception in a Concurrence of upstream's its neighbours have one,
    and would find it in their next run.
    """

    def __init__(self, outcomes=OUTCOMES, **keys):
        smach.State.__init__(self, outcomes=list(outcomes), **keys)
        self.runs = 0

    def execute(self, userdata):
        self.runs += 1
        return 'succeeded'


def fetch_machine(**states):
    """DETECT, PICK, PLACE; states may be given by their labels in lower case."""
    machine = smach.StateMachine(OUTCOMES)
    with machine:
        smach.StateMachine.add('DETECT', states.get('detect') or Works(), {'succeeded': 'PICK'})
        smach.StateMachine.add('PICK', states.get('pick') or Works(), {'succeeded': 'PLACE'})
        smach.StateMachine.add('PLACE', states.get('place') or Works())
    return machine


def sequence_machine():
    """PICK and PLACE in a Sequence."""
    machine = smach.Sequence(OUTCOMES, 'succeeded')
    with machine:
        smach.Sequence.add('PICK', Works())
        smach.Sequence.add('PLACE', Works())
    return machine


def nested_machine():
    """PICK in the machine KITCHEN."""
    machine = smach.StateMachine(OUTCOMES)
    with machine:
        smach.StateMachine.add('KITCHEN', fetch_machine())
    return machine


def concurrence_machine():
    """PICK beside LOOK in the Concurrence BOTH."""
    both = smach.Concurrence(
        OUTCOMES, 'aborted', outcome_map={'succeeded': {'PICK': 'succeeded', 'LOOK': 'succeeded'}}
    )
    with both:
        smach.Concurrence.add('PICK', Works())
        smach.Concurrence.add('LOOK', Works())
    machine = smach.StateMachine(OUTCOMES)
    with machine:
        smach.StateMachine.add('BOTH', both)
    return machine


def iterator_machine():
    """PICK for each of three items in the Iterator EACH."""
    each = smach.Iterator(
        ['succeeded', 'aborted', 'preempted'],
        [],
        [],
        it=[1, 2, 3],
        it_label='item',
        exhausted_outcome='succeeded',
    )
    with each:
        smach.Iterator.set_contained_state('PICK', Works(), loop_outcomes=['succeeded'])
    machine = smach.StateMachine(OUTCOMES)
    with machine:
        smach.StateMachine.add('EACH', each)
    return machine


BUILDERS = [fetch_machine, sequence_machine, nested_machine, concurrence_machine, iterator_machine]
