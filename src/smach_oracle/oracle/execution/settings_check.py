"""Whether the settings of a wrapped machine fit its states."""
from typing import List, Set, Tuple

import smach

from ..errors import SettingsError
from ..machine.nesting import nodes_of
from ..machine.tree_node import TreeNode


def check_state_names(top: TreeNode) -> None:
    """Check that the states for which something is set are somewhere in the tree.

    :raises SettingsError: where one is not; it is logged instead where the node is not strict.
    """
    known = _known_names(top)
    for key, name in _named_states(top):
        if name not in known:
            _refuse(top, SettingsError(
                key, name, 'the states of the machine: ' + ', '.join(sorted(known))))


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
    """Check that preconditions name other states of their container.

    :raises SettingsError: where one does not; it is logged instead where the node is not strict.
    """
    for label in node.labels():
        for spec in node.settings_of(label).preconditions:
            for named in spec.labels():
                if (named not in node.machine._states or named == label
                        or node.is_oracle(named)):
                    others = ', '.join(sorted(other for other in node.labels() if other != label))
                    _refuse(node, SettingsError(
                        'states.{}.preconditions'.format(label), named,
                        'the labels of the other states of {}: {}'.format(node.path, others)))


def _refuse(node: TreeNode, err: SettingsError) -> None:
    if node.strict:
        raise err
    smach.logwarn(str(err))
