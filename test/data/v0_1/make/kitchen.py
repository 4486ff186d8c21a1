#!/usr/bin/env python3
"""Work in a kitchen: machines in a machine, one of them in a Concurrence.

Each argument is the plan of one trial (acting.py).
"""

import rospy
from acting import Act, begin, take

import smach

OUTCOMES = ['succeeded', 'aborted', 'preempted']


def door_is_open(userdata):
    """The check of a precondition's pair: true unless the plan has it otherwise."""
    return take('door') != 'shut'


class OpenAgain(smach.State):
    """The other half of the pair: makes it so, unless the plan has it otherwise."""

    def __init__(self):
        super().__init__(['succeeded', 'aborted'])

    def execute(self, userdata):
        """Do as planned."""
        return take('open_again') or 'succeeded'


def get():
    """Find it, grasp it."""
    machine = smach.StateMachine(outcomes=OUTCOMES, output_keys=['grasp'])
    find = Act('FIND', outputs={'where': 'shelf'})
    grasp = Act('GRASP', input_keys=['where'], outputs={'grasp': 'firm'})
    with machine:
        smach.StateMachine.add('FIND', find, {'succeeded': 'GRASP'})
        smach.StateMachine.add('GRASP', grasp)
    return machine


def clean():
    """Wipe the table, and listen for the bell meanwhile."""
    both = smach.Concurrence(
        outcomes=OUTCOMES,
        default_outcome='aborted',
        outcome_map={'succeeded': {'TABLE': 'succeeded', 'LISTEN': 'succeeded'}},
    )
    table = smach.StateMachine(outcomes=OUTCOMES)
    with table:
        smach.StateMachine.add('WIPE', Act('WIPE'))
    with both:
        smach.Concurrence.add('TABLE', table)
        smach.Concurrence.add('LISTEN', Act('LISTEN'))
    return both


def build():
    """The whole machine."""
    machine = smach.StateMachine(outcomes=OUTCOMES)
    with machine:
        smach.StateMachine.add('OPEN', Act('OPEN'), {'succeeded': 'GET'})
        smach.StateMachine.add('GET', get(), {'succeeded': 'CLEAN'})
        smach.StateMachine.add('CLEAN', clean(), {'succeeded': 'SERVE'})
        smach.StateMachine.add('SERVE', Act('SERVE', input_keys=['grasp']))
    return machine


def main():
    """One trial for each argument."""
    rospy.init_node('kitchen')
    machine = build()
    for word in rospy.myargv()[1:]:
        begin(word, machine)
        try:
            print('OUTCOME', machine.execute(), flush=True)
        except (smach.InvalidUserCodeError, smach.InvalidTransitionError):
            print('ERROR', flush=True)


if __name__ == '__main__':
    main()
