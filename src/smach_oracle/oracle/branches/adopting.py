"""Gives the plain states of the Concurrences and Iterators of a wrapped tree their branches."""

from functools import partial
from typing import Dict, List, Optional, Tuple, cast

import smach

from ..identity import own_attributes, renew_attributes
from ..machine.nesting import WRAPPER, branching_below, why_no_oracle
from ..machine.tree_node import TreeNode
from ..smach_private import Labels, set_mark
from .branch import Branch
from .iterator_wrapper import IteratorWrapper
from .sites import BranchSite, IteratorSite
from .upstream import HOOK, ask_no_more, asks_hook, have_asked
from .wrapper import ContainerWrapper, wrapper_of

Branching = List[Tuple[Labels, smach.Container]]


def adopt_branches(parent: TreeNode) -> Branching:
    """Put the branches below a wrapped machine, down to the next machine, under oracles.

    It returns the Concurrences and Iterators, each with the labels that lead to it.
    """
    found = list(branching_below(parent.machine))
    for labels, container in found:
        wrapper = wrapper_of(container)
        if wrapper is None and parent.in_force.nested:
            wrapper = _new_wrapper(parent, labels, container)
        if wrapper is not None:
            _take_notice(wrapper, parent, labels)
    return found


def release_branches(machine: object) -> None:
    """Give the Concurrences and Iterators below a machine back as they were before."""
    for _, container in list(branching_below(machine)):
        if wrapper_of(container) is not None:
            ask_no_more(container)
            for mark in (WRAPPER, HOOK):
                own_attributes(container).pop(mark, None)


def _new_wrapper(
    parent: TreeNode, labels: Labels, container: smach.Container
) -> Optional[ContainerWrapper]:
    asks = asks_hook(type(container))
    why_not = why_no_oracle(container)
    try:
        if not (asks or why_not):
            have_asked(container)
    except TypeError as err:
        why_not = 'its class cannot be extended ({})'.format(err)
    if why_not:
        path = '/'.join((parent.path, *labels))
        parent.tree.warn_for_good('{}: its states get no oracle, since {}'.format(path, why_not))
        return None
    kind = IteratorWrapper if isinstance(container, smach.Iterator) else ContainerWrapper
    wrapper = kind(container, parent, labels)
    own_attributes(container).update({WRAPPER: wrapper, **({HOOK: wrapper} if asks else {})})
    for marked in (container, wrapper):
        renew_attributes(marked)
    return wrapper


def _take_notice(wrapper: ContainerWrapper, parent: TreeNode, labels: Labels) -> None:
    """Have a branch for each plain state that there is now."""
    if wrapper.parent.tree is not parent.tree:
        wrapper.parent, wrapper.labels_from_parent = parent, labels
    if wrapper.parent is not parent:
        return  # it is in two places: the first one is used
    found: Dict[str, Branch] = {}
    for label, state in wrapper.states():
        if label and not isinstance(state, smach.Container):
            branch = wrapper.branches.get(label)
            if branch is None and parent.wraps(labels + (label,)):
                branch = _new_branch(wrapper, label)
            if branch is not None:
                found[label] = branch
                branch.take(wrapper.container, state)
    wrapper.branches = found


def _new_branch(wrapper: ContainerWrapper, label: str) -> Branch:
    """Make a branch, which is then adopted as a nested machine is."""
    parent, container = wrapper.parent, wrapper.container
    is_item = isinstance(wrapper, IteratorWrapper)
    branch = Branch(label, is_alone=is_item)
    site = partial(IteratorSite if is_item else BranchSite, container=container, label=label)
    machine = cast('smach.StateMachine', branch)
    node = TreeNode(machine, parent.tree, parent.settings, '', site)
    set_mark(branch, node)
    renew_attributes(branch)
    node.in_force.inherit(parent.in_force)
    return branch
