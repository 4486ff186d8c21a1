"""Finds what has changed in a script since its trial was stored, and its states' new names."""

from typing import Collection, List, Mapping, NamedTuple, Optional

import smach
from smach_oracle.store.names import STRUCTURE
from smach_oracle.store.renaming import Renaming, containers_of, states_of
from smach_oracle.store.rows import StoredTrial
from smach_oracle.store.store_file import StoreFile

from ..errors import SettingsError
from ..machine.tree_node import TreeNode
from .stored_tree import StoredTree
from .structure import Structure, differences


class ChangedScript(NamedTuple):
    """The differences between a script and the one that was stopped.

    `names`: paths of states by those that they had, empty where nobody has told them.
    """

    before: str  # id of its structure
    changes: List[str]
    names: Mapping[str, str]
    renaming: Optional[Renaming]


def changed_script(
    top: TreeNode, store: StoreFile, trial: StoredTrial, tree: StoredTree, now: Structure
) -> ChangedScript:
    """Return how a script differs from the one of a stored trial.

    :raises SettingsError: where `resume_map` names a state that was not there, or is not.
    """
    before = tree.whole.get(STRUCTURE) or trial.structure
    names = top.settings.resume_map
    if before == now.id:
        _name_unknown(top, names, store, now)
        return ChangedScript(before, [], {}, None)
    described = store.description(before)
    changes = differences(described, now.description)
    if not names:
        return ChangedScript(before, changes, {}, None)
    known, present = states_of(described), states_of(now.description)
    for old, new in names.items():
        _check(old, old, known, 'a state of the machine that was stopped')
        _check(old, new, present, 'a state of the machine')
    return ChangedScript(
        before, changes, names, Renaming(top.name, names, containers_of(described))
    )


def _name_unknown(
    top: TreeNode, names: Mapping[str, str], store: StoreFile, now: Structure
) -> None:
    """Warn of states of a map of no effect that neither this script has, nor one of before."""
    if not names:
        return
    known = set(states_of(now.description)).union(
        *(
            states_of(store.description(each))
            for each in {trial.structure for trial in store.trials(top.name)}
        )
    )
    for path in sorted({path for pair in names.items() for path in pair}.difference(known)):
        smach.logwarn(
            '{}: resume_map names {!r}, which is not a state of the machine, and was '
            'not one before; there are {}'.format(
                top.path, path, ', '.join(sorted(states_of(now.description)))
            )
        )


def _check(old: str, path: str, known: Collection[str], what: str) -> None:
    if path not in known:
        raise SettingsError(
            'resume_map.' + old, path, '{}: {}'.format(what, ', '.join(sorted(known)))
        )
