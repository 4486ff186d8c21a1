"""A failure while the robot was not well: it is not counted, and the state runs again after that.

Such a visit is no visit: it is in no history, no rate and no count, and the observers are told of
no failure, transition or jump. They are told that the machine waits.
"""

import time
from typing import Optional

import smach

from ..machine.tree_node import TreeNode


def why_unwell_after(node: TreeNode) -> Optional[str]:
    """Return why the robot was not well when a state has just failed, None where it was.

    It looks for the settle time. Where a preempt or a shutdown comes meanwhile, it returns '':
    nothing is a failure then.
    """
    machine = node.machine

    def stopped() -> bool:
        return machine.preempt_requested() or smach.is_shutdown() or node.is_left_behind()

    lock = machine._state_transitioning_lock
    lock.release()
    try:
        why = node.tree.health.unwell_after(stopped, time.sleep)
    finally:
        lock.acquire()
    return '' if stopped() else why or None
