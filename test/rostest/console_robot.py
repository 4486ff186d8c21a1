#!/usr/bin/env python3
"""A robot for the console's tests: a real machine under a real oracle, whose PICK fails until its
work is done.
"""

import sys

import rospy

import smach
from smach_oracle import OracleContainer
from smach_ros import IntrospectionServer

MARKUP = 'no grasp found for <b>mug</b> & <script>window.hacked = 1</script>'
OUTCOMES = ['succeeded', 'aborted', 'preempted']


class Work(smach.State):
    """Succeeds after some time; the labels in `failing` fail."""

    def __init__(self, label, failing, time_s, output_keys=(), input_keys=()):
        smach.State.__init__(
            self, OUTCOMES, input_keys=list(input_keys), output_keys=list(output_keys)
        )
        self._label = label
        self._failing = failing
        self._time_s = time_s
        self._outputs = output_keys

    def execute(self, ud):
        rospy.sleep(self._time_s)  # the state takes so long
        if self._label in self._failing:
            raise RuntimeError(rospy.get_param('~reason', MARKUP))
        for key in self._outputs:
            ud[key] = 'done by ' + self._label
        return 'succeeded'


def chain(labels, make, **more):
    """A machine of states one after the other. `more`: transitions that each state has."""
    sm = smach.StateMachine(OUTCOMES)
    with sm:
        for label, following in zip(labels, list(labels[1:]) + ['succeeded']):
            smach.StateMachine.add(label, make(label), dict(more, succeeded=following))
    return sm


def make_machine(failing, time_s, size):
    """Fetch, nested: DETECT, PICK, PLACE; `size`: so many further states around it."""

    def pick(label):
        return Work(
            label,
            failing,
            time_s,
            ['grasp'] if label == 'PICK' else [],
            {'PICK': ['object'], 'PLACE': ['grasp']}.get(label, []),
        )

    inner = chain(['DETECT', 'PICK', 'PLACE'], pick)
    inner.register_input_keys(['object'])
    labels = ['STEP_{:02}_OF_A_LONG_JOB'.format(number) for number in range(size)]
    sm = chain(
        ['MOVE_ARMS_ASIDE', 'FETCH'] + labels,
        lambda label: inner if label == 'FETCH' else Work(label, failing, time_s),
        **({'preempted': 'preempted'} if size > 50 else {}),  # as authors of large machines do
    )
    sm.userdata.object = {'name': 'mug', 'weight_kg': 0.3}
    return sm


def main(argv):
    """Arguments: failing labels with commas, s that a state takes, further states, trials, prior
    failure rate.
    """
    failing, time_s, size, trials = argv[1].split(','), float(argv[2]), int(argv[3]), int(argv[4])
    # so high that every failure is a question at once
    prior = float(argv[5]) if len(argv) > 5 else 0.8
    rospy.init_node('robot')
    sm = make_machine(failing, time_s, size)
    OracleContainer.wrap(
        sm,
        name='KITCHEN',
        settings={
            'prior': prior,
            'high_from': 0.75,
            'expert': {
                'deadline_s': 300.0,
                'interfaces': {
                    'assist': {
                        'action': '/assist',
                        'description': 'Guide the hand',
                        'states': ['PICK'],
                    }
                },
            },
            'tree': {'escalate': False},
            'states': {'FETCH/PICK': {'preconditions': ['DETECT']}},
        },
    )
    if rospy.get_param('~own_introspection', False):
        IntrospectionServer('/a_server_of_its_own', sm, '/SM_ROOT').start()
    for _ in range(trials):
        if rospy.is_shutdown():
            break
        sm.execute()
    rospy.spin()


if __name__ == '__main__':
    main(rospy.myargv(sys.argv))
