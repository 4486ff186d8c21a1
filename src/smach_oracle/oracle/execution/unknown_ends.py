"""Says which ends of a machine have names that tell neither success nor failure."""

from typing import Set, Tuple

import smach

from ..machine.tree_node import TreeNode

UNKNOWN_ENDS = (
    '{}: nothing says whether an end in {} is a success or a failure. Statistics count it as '
    '"other end". To settle it, list all failing ends in failing_outcomes, or choose a name that '
    'says it, such as {}_succeeded'
)
_MOST_TOLD = 1000  # machines. A program may make up machines without end
_told: Set[Tuple[str, Tuple[str, ...]]] = set()


def tell_unknown_ends(top: TreeNode) -> None:
    """Name the ends of the top machine whose meaning is not known, once in a process."""
    ends = top.site.shown(top).get_registered_outcomes()
    unknown = top.in_force.rule.unknown(ends)
    if not unknown or (top.path, unknown) in _told or len(_told) >= _MOST_TOLD:
        return
    _told.add((top.path, unknown))
    smach.loginfo(UNKNOWN_ENDS.format(top.path, ' or '.join(unknown), unknown[0]))
