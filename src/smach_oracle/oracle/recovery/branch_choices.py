"""What a question says of Concurrences and Iterators: where outcomes lead, what runs again."""
from typing import Tuple

import smach

from ..asking.question import OutcomeChoice
from ..machine.tree_node import TreeNode


def outcomes_of_branch(node: TreeNode, state: smach.State) -> Tuple[OutcomeChoice, ...]:
    """Return the outcomes of a branch, and in words where they lead; none where it is no branch.

    Those that go on with the next item come first.
    """
    branch = node.branch
    if branch is None:
        return ()
    last = [(not branch.goes_on_after(outcome), str(outcome), outcome)
            for outcome in state.get_registered_outcomes()]
    return tuple(OutcomeChoice(outcome, branch.leads_to(outcome))
                 for _, _, outcome in sorted(last))


def running_again(node: TreeNode, label: str) -> Tuple[str, ...]:
    """Return the branches that would all run again if the machine went to a state."""
    state = node.machine._states[label]
    if not isinstance(state, smach.Concurrence):
        return ()
    return tuple(map(str, state.get_children()))
