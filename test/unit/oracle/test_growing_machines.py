"""A machine may grow in one thread while another one looks through the tree."""

import gc
import sys
import threading

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.machine.nesting import containers_in

GROWN = 600  # states


def test_a_tree_can_be_looked_through_while_a_machine_of_it_grows():
    top = smach.StateMachine(['done'])
    with top:
        smach.StateMachine.add('A', smach.CBState(lambda ud: 'done', outcomes=['done']))
    OracleContainer.wrap(top)
    grown, looks, errors = threading.Event(), [], []

    def look():
        while not grown.is_set():
            try:
                looks.append(len(containers_in(top)))
            except RuntimeError as err:
                errors.append(err)

    def collected(phase, info):
        """Run code in the midst of what is one step to other threads, as a finalizer does."""
        return [phase for _ in range(50)]

    interval, threshold = sys.getswitchinterval(), gc.get_threshold()
    sys.setswitchinterval(1e-6)
    gc.callbacks.append(collected)
    gc.set_threshold(5)
    try:
        thread = threading.Thread(target=look)
        thread.start()
        for number in range(GROWN):
            with top:
                state = smach.CBState(lambda ud: 'done', outcomes=['done'])
                smach.StateMachine.add('X{}'.format(number), state)
        grown.set()
        thread.join(20)
    finally:
        gc.set_threshold(*threshold)
        gc.callbacks.remove(collected)
        sys.setswitchinterval(interval)
    assert looks and not errors
