"""Describes a tree of containers, and finds what has changed in a script since it was stored."""

import hashlib
import json
from typing import (
    Collection,
    Dict,
    Iterable,
    Iterator,
    List,
    Mapping,
    NamedTuple,
    Optional,
    Tuple,
    cast,
)

import smach
from smach_oracle.store import renaming
from smach_oracle.store.names import STRUCTURE
from smach_oracle.store.renaming import Renaming
from smach_oracle.store.rows import StoredTrial
from smach_oracle.store.store_file import StoreFile

from ..errors import SettingsError
from ..machine.nesting import children_of
from ..settings.failing_outcomes import name_text
from ..settings.settings import GROUPS
from ..smach_private import (
    final_outcomes_of,
    initial_label_of,
    loop_outcomes_of,
    outcome_map_of,
    remapping_of,
    transitions_in,
)
from .stored_tree import StoredTree

DIGITS = 16  # of the id
Plain = Mapping[str, object]


class Structure(NamedTuple):
    """The structure of a tree: its id, and its description as JSON."""

    id: str
    description: str


def structure_of(machine: smach.Container, meta: str) -> Structure:
    """Return the structure of a tree.

    It has every container with its states, their classes, outcomes and keys, and its transitions.
    Settings are not part of it, and neither is the meta state.

    :param meta: the label of the meta state, '' where no oracle recovers.
    """
    described = {
        path: _container(container, meta) for path, container in _containers(machine, '', meta)
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
    for path, was, now_is in _pairs(before, after):
        name = path or 'the top machine'
        if was is None or now_is is None:
            found.append('container {} is {}'.format(name, 'gone' if now_is is None else 'new'))
        else:
            found += ('{}: {}'.format(name, text) for text in _between(was, now_is))
    return found


def _pairs(before: object, after: object) -> Iterator[Tuple[str, Optional[Plain], Optional[Plain]]]:
    """Yield what two mappings have under each name, None where one of them has it not."""
    one, other = cast('Mapping[str, Plain]', before), cast('Mapping[str, Plain]', after)
    for name in sorted({*one, *other}):
        yield name, one.get(name), other.get(name)


def _between(before: Plain, after: Plain) -> Iterator[str]:
    if before['kind'] != after['kind']:
        yield 'it was a {}, and is a {}'.format(before['kind'], after['kind'])
    for label, was, now in _pairs(before['states'], after['states']):
        if was is None or now is None:
            yield 'state {} is {}'.format(label, 'gone' if now is None else 'new')
        else:
            for text in _state_differences(was, now):
                yield 'state {}: {}'.format(label, text)
    for what in ('outcomes', 'initial', 'input_keys', 'output_keys', 'rules'):
        if before.get(what) != after.get(what):
            yield '{} were {}, and are {}'.format(
                what.replace('_', ' '), _shown(before.get(what)), _shown(after.get(what))
            )


def _state_differences(before: Plain, after: Plain) -> Iterator[str]:
    for outcome, was, now in _pairs(before['transitions'], after['transitions']):
        if was != now:
            yield '{} led to {}, and leads to {}'.format(
                outcome, was or 'nothing', now or 'nothing'
            )
    for what in ('class', 'keys', 'remapping'):
        if before[what] != after[what]:
            yield '{} was {}, and is {}'.format(what, _shown(before[what]), _shown(after[what]))


def _shown(value: object) -> str:
    return value if isinstance(value, str) else json.dumps(value)


def _containers(
    container: smach.Container, path: str, meta: str
) -> Iterator[Tuple[str, smach.Container]]:
    yield path, container
    for label, state in sorted(_states(container, meta).items()):
        if isinstance(state, smach.Container):
            yield from _containers(state, '{}/{}'.format(path, label) if path else label, meta)


def _states(container: smach.Container, meta: str) -> Dict[str, smach.State]:
    states = dict(children_of(container))
    return {name_text(label): state for label, state in states.items() if label != meta}


def _container(container: smach.Container, meta: str) -> Plain:
    return {
        'kind': _kind(container),
        'outcomes': _sorted(container.get_registered_outcomes()),
        'input_keys': _sorted(container.get_registered_input_keys()),
        'output_keys': _sorted(container.get_registered_output_keys()),
        'initial': initial_label_of(container),
        'states': {
            label: _state(container, label, state)
            for label, state in _states(container, meta).items()
        },
        'rules': _rules(container),
    }


def _sorted(names: Iterable[object]) -> List[str]:
    return sorted(map(str, names))


def _kind(state: object) -> str:
    """Return the name of a state's class, the same whether it is wrapped or not."""
    kinds = (smach.Concurrence, smach.Iterator, smach.Sequence, smach.StateMachine)
    return str(next((kind for kind in kinds if isinstance(state, kind)), type(state)).__name__)


def _rules(container: smach.Container) -> List[str]:
    """Return what a Concurrence or an Iterator goes by, as far as it can be told in words."""
    if isinstance(container, smach.Iterator):
        final = dict(final_outcomes_of(container))
        return [
            *_sorted(loop_outcomes_of(container)),
            '->',
            *sorted('{}:{}'.format(*item) for item in final.items()),
        ]
    return _sorted(outcome_map_of(container)) if isinstance(container, smach.Concurrence) else []


def _state(container: smach.Container, label: str, state: smach.State) -> Plain:
    keys = (
        [state.get_registered_input_keys(), state.get_registered_output_keys()]
        if isinstance(state, smach.State)
        else []
    )
    transitions, remapping = transitions_in(container, label), remapping_of(container, label)
    return {
        'class': _kind(state),
        'transitions': {str(outcome): str(target) for outcome, target in transitions.items()},
        'keys': list(map(_sorted, keys)),
        'remapping': {str(one): str(other) for one, other in remapping.items()},
    }


class ChangedScript(NamedTuple):
    """The differences between a script and the one that was stopped.

    `names`: paths of states by those that they had, empty where nobody has told them.
    """

    before: str  # id of its structure
    changes: List[str]
    names: Mapping[str, str]
    renaming: Optional[Renaming]


def changed_script(
    names: Mapping[str, str],
    store: StoreFile,
    trial: StoredTrial,
    tree: StoredTree,
    now: Structure,
) -> ChangedScript:
    """Return how a script differs from the one of a stored trial.

    :param names: the setting `resume_map`.
    :raises SettingsError: where `resume_map` names a state that was not there, or is not.
    """
    before = str(tree.whole.get(STRUCTURE) or trial.structure)
    if before == now.id:
        _name_unknown(trial.machine, names, store, now)
        return ChangedScript(before, [], {}, None)
    described = store.description(before)
    changes = differences(described, now.description)
    if not names:
        return ChangedScript(before, changes, {}, None)
    known, present = renaming.states_of(described), renaming.states_of(now.description)
    for old, new in names.items():
        _check(old, old, known, 'a state of the machine that was stopped')
        _check(old, new, present, 'a state of the machine')
    return ChangedScript(
        before, changes, names, Renaming(trial.machine, names, renaming.containers_of(described))
    )


def _name_unknown(name: str, names: Mapping[str, str], store: StoreFile, now: Structure) -> None:
    """Warn of states of a map of no effect that neither this script has, nor one of before."""
    if not names:
        return
    known = set(renaming.states_of(now.description)).union(
        *(
            renaming.states_of(store.description(each))
            for each in {trial.structure for trial in store.trials(name)}
        )
    )
    for path in sorted({path for pair in names.items() for path in pair}.difference(known)):
        smach.logwarn(
            '{}: {} names {!r}, which is not a state of the machine, and was '
            'not one before; there are {}'.format(
                name,
                GROUPS.key_of('resume_map'),
                path,
                ', '.join(sorted(renaming.states_of(now.description))),
            )
        )


def _check(old: str, path: str, known: Collection[str], what: str) -> None:
    if path not in known:
        raise SettingsError(
            '{}.{}'.format(GROUPS.key_of('resume_map'), old),
            path,
            '{}: {}'.format(what, ', '.join(sorted(known))),
        )
