"""Leaving containers for a level above: what a verdict far below means on the way there.

A recovery in one container may send the machine to a state of another. The containers from the
failure up to the one that goes on are left: those on the way end at once, and what runs beside them
is preempted, and waited for.
"""

from typing import List, Optional, Tuple, cast

import smach

from ..branches.iterator_wrapper import IteratorWrapper
from ..branches.wrapper import wrapper_of
from ..machine.nesting import gave_up_in, nodes_in
from ..machine.places import levels_above, links_to
from ..machine.tree_node import TreeNode
from ..machine.workers import request_preempt
from ..records.events import FailureKind
from ..recovery.failure import Failure
from ..recovery.verdict import Departure, GiveUp, JumpTo, Verdict
from ..smach_private import current_label_of, current_state_of, states_of


def depart(node: TreeNode, label: str, verdict: Verdict, level: TreeNode) -> bool:
    """Leave the containers between a failure and the level above that goes on.

    Return whether they are left.

    They are not where another departure came before, such as that of a concurrent branch. That one
    leaves the containers in between, too.

    To be called in the thread of the failed state's container, its lock not held: what runs in the
    containers is preempted.
    """
    levels = [node, *levels_above(node)]
    if level not in levels:
        return False
    departure = Departure(verdict, level, '/'.join((node.path, label)))
    nodes = levels[: levels.index(level) + 1]
    others, leaving = _claim(nodes, departure)
    if others:
        request_preempt(_container_apart(nodes, others, leaving))
        _preempt_left_nodes(nodes[: -len(others)])
        return False
    smach.loginfo(
        '{}/{} is left for {}'.format(
            level.path, current_label_of(level.machine), _in_words(verdict)
        )
    )
    request_preempt(current_state_of(level.machine))
    _preempt_left_nodes(nodes[:-1])
    return True


def _in_words(verdict: Verdict) -> str:
    if isinstance(verdict, JumpTo):
        return verdict.jump_path.place.path
    return 'its end with {}'.format(cast('GiveUp', verdict).ending.outcome)


def _preempt_left_nodes(left_nodes: List[TreeNode]) -> None:
    """Preempt the containers around a failure that are left, as far as they are not yet.

    Iterators among them are told that they are left. Upstream's Concurrence hands a preempt on at
    some time later, and once in an execution. Until then an Iterator on the way would go on with
    its next item.

    :param left_nodes: innermost first. That of the failure ends by itself.
    """
    around = [link.inner_container for node in reversed(left_nodes) for link in links_to(node)]
    for container in around:
        wrapper = wrapper_of(container)
        if isinstance(wrapper, IteratorWrapper):
            wrapper.is_left = True
    for container in around[:-1]:
        if not container.preempt_requested():
            request_preempt(container)


def _claim(nodes: List[TreeNode], departure: Departure) -> Tuple[List[TreeNode], Departure]:
    """Have containers left by a departure.

    Return those that another one leaves, which has come before, and by which departure the others
    are left.
    """
    with departure.arrives_at.tree.departures_lock:
        first = next(
            (index for index, each in enumerate(nodes) if each.execution.departure is not None),
            len(nodes),
        )
        others = nodes[first:]
        leaving = cast('Departure', others[0].execution.departure) if others else departure
        for each in nodes[:first]:
            each.execution.depart_by(leaving)
    for each in nodes[1:first]:
        record = each.records.by_label.get(current_label_of(each.machine))
        if record is not None:
            record.retire_edges()  # its visit ends by no plain success
    return others, leaving


def _container_apart(
    nodes: List[TreeNode], others: List[TreeNode], leaving: Departure
) -> Optional[smach.State]:
    """Return the outermost container around a failure that another departure does not leave.

    What runs in it was preempted by that one, but may have gone on. None where it is the failed
    state's own.

    :param others: the last ones of `nodes`, which the other departure leaves.
    """
    if len(others) == len(nodes):
        return None
    path, below = others[0].path, nodes[-len(others) - 1]
    for link in links_to(below):
        path = '/'.join((path, link.label))
        if not leaving.failed_path.startswith(path + '/'):
            return None if link.inner_container is nodes[0].machine else link.inner_container
    return None


def take_departure(node: TreeNode) -> Optional[Departure]:
    """Return the departure that the end of the present state is part of, once."""
    if node.execution.departure is None:
        return None
    departure = cast('Departure', node.execution.departure)
    node.execution.depart_by(None)
    stops = departure.arrives_at.execution.scope.reason is not None
    return None if stops else departure


def is_settled(node: TreeNode, failure: Failure) -> bool:
    """Whether a state has failed because the oracle of a container in it gave up.

    That failure has had its account: no level above recovers from it, or asks about it again. An
    overrun of the state is a failure of its own.
    """
    state = states_of(node.machine)[failure.state]
    if not gave_up_in(state):
        return False
    for each in nodes_in(state):
        each.execution.forget_unrecovered()
    return failure.kind is not FailureKind.TIME_LIMIT
