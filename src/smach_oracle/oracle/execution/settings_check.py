"""Checks that the settings of a wrapped machine fit its states."""
from typing import List, Set, Tuple

import smach

from ..errors import SettingsError
from ..machine.nesting import nodes_of, paths_below
from ..machine.tree_node import TreeNode
from ..places.fitness import allowed_for, why_unfit
from ..settings.close_names import did_you_mean
from ..settings.patterns import matches
from ..settings.preconditions import PreconditionSpec


def check_state_names(top: TreeNode) -> None:
    """Check that the states for which something is set are somewhere in the tree.

    :raises SettingsError: where one is not. It is logged instead where the node is not strict.
    """
    known = _known_names(top)
    for key, name in _named_states(top):
        if name not in known and not any(matches(name, each) for each in known):
            _refuse(top, SettingsError(
                key, name, 'the states of the machine: ' + ', '.join(sorted(known)),
                problem='is no state' + did_you_mean(name, known)))


def check_nested(top: TreeNode) -> None:
    """Check that each path or pattern of `nested` stands for something.

    :raises SettingsError: where one does not. It is logged instead where the node is not strict.
    """
    if isinstance(top.nested, bool):
        return
    known = sorted(set(paths_below(top.machine)))
    for name in top.nested:
        if not any(matches(name, path) for path in known):
            _refuse(top, SettingsError(
                'nested', name, 'a path or a pattern of the machines in {}, and of the states of '
                'its Concurrences and Iterators: {}'.format(top.path, ', '.join(known) or 'none'),
                problem='names nothing in {}{}'.format(top.path, did_you_mean(name, known))))


def _known_names(top: TreeNode) -> Set[str]:
    known: Set[str] = set()
    for node in nodes_of(top.machine):
        path = node.relative_path
        for label in node.labels():
            known.update((label, '{}/{}'.format(path, label) if path else label))
    return known


def _named_states(top: TreeNode) -> List[Tuple[str, str]]:
    """Each key of the settings that names a state, and the name."""
    named = [('states.' + name, name) for name in top.settings.states]
    return named + [('interfaces.{}.states'.format(offer.name), name)
                    for offer, states in top.settings.interfaces for name in states]


def check_preconditions(node: TreeNode) -> None:
    """Check that preconditions name states that can be run for the state.

    These are others of its container by label, and states of other containers by path.

    :raises SettingsError: where one does not. It is logged instead where the node is not strict.
    """
    for label in node.labels():
        for spec in _preconditions_of(node, label):
            for named in spec.labels():
                why_not = why_unfit(node, label, named)
                if why_not:
                    _refuse(node, SettingsError(
                        'states.{}.preconditions'.format(label), named, allowed_for(node, label),
                        problem='is not allowed: ' + why_not))


def _preconditions_of(node: TreeNode, label: str) -> Tuple[PreconditionSpec, ...]:
    if node.branch is None:
        return node.settings_of(label).preconditions
    # labels given for all states of this label are meant for others: none is beside a branch
    path = '{}/{}'.format(node.relative_path, label)
    given = node.settings.states.get(path, {}).get('preconditions')
    return tuple(given or ())


def _refuse(node: TreeNode, err: SettingsError) -> None:
    if node.strict:
        raise err
    smach.logwarn(str(err))
