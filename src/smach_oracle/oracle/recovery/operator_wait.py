"""Waits for an operator where no machine's lock is held: before a precondition, between items."""

import contextlib
from typing import Iterator

from ..control.hold import HeldPlace
from ..control.holding import Wait, wait_until_let_go
from ..machine.limited_run import standing_still
from ..machine.tree_node import TreeNode
from ..scope.scope import Scope
from ..settings.settings import CONFIRM_FIRST
from ..smach_private import Labels


@contextlib.contextmanager
def clocks_stand_still(node: TreeNode) -> Iterator[None]:
    """Let the time limits around a container stand still, and the minutes of its trial."""
    with standing_still(node.execution.runs_around), node.tree.budget.time.paused():
        yield


def wait_for_operator(
    node: TreeNode, below: Labels, name: str, autonomy: str, scope: Scope
) -> None:
    """Wait before something begins, where an operator holds it.

    :param below: labels of a Concurrence or an Iterator in the container, of which it is a part.
    :param name: its label, or that of a function.
    :param autonomy: of what begins, by its settings.
    :param scope: ends the wait.
    """
    control = node.tree.control
    if not control.is_set and autonomy != CONFIRM_FIRST:
        return
    place = HeldPlace('/'.join((node.path, *below)), name)
    confirms = control.level_of(place, autonomy) == CONFIRM_FIRST
    hold = control.hold_before(place, confirms, scope.reason is None)
    if hold is not None:
        hold.may_be_sent, hold.autonomy = False, autonomy
        wait_until_let_go(control, hold, Wait(node, clocks_stand_still(node), scope))
