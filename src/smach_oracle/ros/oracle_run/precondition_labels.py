"""A check that the preconditions in the settings name states of a script's machine."""
import gc
from typing import Dict, Iterator, List, NamedTuple, Set, Tuple

import smach
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.settings.close_names import did_you_mean
from smach_oracle.oracle.settings.settings import Settings


class _Use(NamedTuple):
    """A precondition that names a state, where it is used."""

    key: str
    named: str
    others: Tuple[str, ...]  # the labels that it may name there

    def names(self, paths: Set[str]) -> Set[str]:
        """Return all that may be meant: those labels, or the paths of the machine."""
        return paths | {'/' + each for each in paths} if '/' in self.named else set(self.others)


def misplaced_preconditions(machine: smach.StateMachine,
                            settings: Settings) -> List[SettingsError]:
    """Return the preconditions that name no other state beside the state that they are for.

    A label may occur in several nested machines: it is enough that the precondition fits one. A
    path has to be that of a state.
    """
    wrong: Dict[Tuple[str, str], _Use] = {}
    right = set()
    paths = set(_paths(machine, ''))
    for use in _uses(machine, settings, ''):
        if use.named in use.others or ('/' in use.named and use.named.lstrip('/') in paths):
            right.add(use[:2])
        else:
            wrong.setdefault(use[:2], use)
    return [SettingsError(use.key, use.named, 'the labels of the other states there: '
                          + ', '.join(use.others),
                          problem='is not allowed' + did_you_mean(use.named, use.names(paths)))
            for place, use in wrong.items() if place not in right]


def is_label_elsewhere(name: str, machine: smach.StateMachine) -> bool:
    """Whether a container of this process that is not in the machine has a state of this name."""
    own = {id(each) for each in _containers(machine)}
    return any(id(each) not in own and name in _children(each) for each in gc.get_objects()
               if isinstance(each, smach.Container))


def _containers(container: smach.Container) -> Iterator[smach.Container]:
    yield container
    for state in _children(container).values():
        if isinstance(state, smach.Container):
            yield from _containers(state)


def _uses(container: smach.Container, settings: Settings, path: str) -> Iterator[_Use]:
    children = _children(container)
    for label, state in children.items():
        below = '{}/{}'.format(path, label) if path else label
        if isinstance(container, smach.StateMachine):
            others = tuple(sorted(other for other in children if other != label))
            for spec in settings.for_state(path, label).preconditions:
                key = below if 'preconditions' in settings.states.get(below, ()) else label
                for named in spec.labels():
                    yield _Use('states.{}.preconditions'.format(key), named, others)
        if settings.nested and isinstance(state, smach.Container):
            yield from _uses(state, settings, below)


def _paths(container: smach.Container, above: str) -> Iterator[str]:
    """Yield the paths of all states in a container."""
    for label, state in _children(container).items():
        path = '{}/{}'.format(above, label) if above else label
        yield path
        if isinstance(state, smach.Container):
            yield from _paths(state, path)


def _children(container: smach.Container) -> Dict[str, smach.State]:
    """The states by label. None where an Iterator has no contained state yet."""
    try:
        return dict(container.get_children())
    except (AttributeError, TypeError):
        return {}
