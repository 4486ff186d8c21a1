"""Describes a tree of containers, and finds what has changed in a script since it was stored."""

import hashlib
import json
from typing import Any, Collection, Dict, Iterator, List, Mapping, NamedTuple, Optional, Tuple

import smach
from smach_oracle.store.names import STRUCTURE
from smach_oracle.store.renaming import Renaming, containers_of, states_of
from smach_oracle.store.rows import StoredTrial
from smach_oracle.store.store_file import StoreFile

from ..errors import SettingsError
from ..identity import own_mark
from ..machine.tree_node import TreeNode
from .stored_tree import StoredTree

DIGITS = 16  # of the id


class Structure(NamedTuple):
    """The structure of a tree: its id, and its description as JSON."""

    id: str
    description: str


def structure_of(top: TreeNode) -> Structure:
    """Return the structure of a tree.

    It has every container with its states, their classes, outcomes and keys, and its transitions.
    Settings and the meta state are none of it.
    """
    described = {
        path: _container(container, meta)
        for path, container, meta in _containers(
            top.machine, '', top.settings.oracle_label if top.tree.recover else ''
        )
    }
    text = json.dumps(described, sort_keys=True, separators=(',', ':'))
    return Structure(
        hashlib.blake2b(text.encode('ascii'), digest_size=DIGITS // 2).hexdigest(), text
    )


def differences(stored: str, now: str) -> List[str]:
    """Return what has changed from one description to another, one sentence each."""
    try:
        before, after = json.loads(stored), json.loads(now)
    except ValueError:
        return ['the stored machine cannot be read']
    found: List[str] = []
    for path in sorted(set(before).union(after)):
        name = path or 'the top machine'
        if path not in after:
            found.append('container {} is gone'.format(name))
        elif path not in before:
            found.append('container {} is new'.format(name))
        else:
            found += ('{}: {}'.format(name, text) for text in _between(before[path], after[path]))
    return found


def _between(before: Mapping[str, Any], after: Mapping[str, Any]) -> Iterator[str]:
    if before['kind'] != after['kind']:
        yield 'it was a {}, and is a {}'.format(before['kind'], after['kind'])
    states, states_now = before['states'], after['states']
    for label in sorted(set(states).union(states_now)):
        if label not in states_now:
            yield 'state {} is gone'.format(label)
        elif label not in states:
            yield 'state {} is new'.format(label)
        else:
            yield from _state_differences(label, states[label], states_now[label])
    for what in ('outcomes', 'initial', 'input_keys', 'output_keys', 'rules'):
        if before.get(what) != after.get(what):
            yield '{} were {}, and are {}'.format(
                what.replace('_', ' '), _shown(before.get(what)), _shown(after.get(what))
            )


def _state_differences(
    label: str, before: Mapping[str, Any], after: Mapping[str, Any]
) -> Iterator[str]:
    for outcome in sorted(set(before['transitions']).union(after['transitions'])):
        was, now = before['transitions'].get(outcome), after['transitions'].get(outcome)
        if was != now:
            yield 'state {}: {} led to {}, and leads to {}'.format(
                label, outcome, was or 'nothing', now or 'nothing'
            )
    for what in ('class', 'keys', 'remapping'):
        if before[what] != after[what]:
            yield 'state {}: {} was {}, and is {}'.format(
                label, what, _shown(before[what]), _shown(after[what])
            )


def _shown(value: object) -> str:
    return value if isinstance(value, str) else json.dumps(value)


def _containers(container: Any, path: str, meta: str) -> Iterator[Tuple[str, Any, str]]:
    yield path, container, meta
    for label, state in sorted(_states(container, meta).items()):
        if isinstance(state, smach.Container):
            yield from _containers(state, '{}/{}'.format(path, label) if path else label, meta)


def _states(container: Any, meta: str) -> Dict[str, Any]:
    children = (
        container._states if isinstance(container, smach.StateMachine) else container.get_children()
    )
    return {str(label): state for label, state in dict(children).items() if label != meta}


def _container(container: Any, meta: str) -> Dict[str, Any]:
    return {
        'kind': _kind(container),
        'outcomes': sorted(map(str, container.get_registered_outcomes())),
        'input_keys': sorted(map(str, container.get_registered_input_keys())),
        'output_keys': sorted(map(str, container.get_registered_output_keys())),
        'initial': str(own_mark(container, '_initial_state_label') or ''),
        'states': {
            label: _state(container, label, state)
            for label, state in _states(container, meta).items()
        },
        'rules': _rules(container),
    }


def _kind(container: Any) -> str:
    for kind in (smach.Concurrence, smach.Iterator, smach.Sequence, smach.StateMachine):
        if isinstance(container, kind):
            return str(kind.__name__)
    return type(container).__name__


def _rules(container: Any) -> List[str]:
    """Return what a Concurrence or an Iterator goes by, as far as it can be told in words."""
    if isinstance(container, smach.Iterator):
        return (
            sorted(map(str, container._loop_outcomes))
            + ['->']
            + sorted('{}:{}'.format(*item) for item in dict(container._final_outcome_map).items())
        )
    if isinstance(container, smach.Concurrence):
        return sorted(map(str, container._outcome_map))
    return []


def _state(container: Any, label: str, state: Any) -> Dict[str, Any]:
    transitions = (own_mark(container, '_transitions') or {}).get(label) or {}
    remapping = (own_mark(container, '_remappings') or {}).get(label) or {}
    is_state = isinstance(state, smach.State)
    return {
        'class': _class_of(state),
        'transitions': {str(outcome): str(target) for outcome, target in dict(transitions).items()},
        'keys': [
            sorted(map(str, state.get_registered_input_keys())),
            sorted(map(str, state.get_registered_output_keys())),
        ]
        if is_state
        else [],
        'remapping': {str(one): str(other) for one, other in dict(remapping).items()},
    }


def _class_of(state: Any) -> str:
    """Return the name of a state's class, the same whether it is wrapped or not."""
    if isinstance(state, smach.Container):
        return _kind(state)
    return type(state).__name__


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
