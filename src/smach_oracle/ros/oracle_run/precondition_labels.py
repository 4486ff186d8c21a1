"""A check that the preconditions in the settings name states of a script's machine."""

from typing import Dict, Iterator, List, NamedTuple, Set, Tuple

import smach
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.settings.names import did_you_mean
from smach_oracle.oracle.settings.settings import Settings

from ..reading.known_names import children_of


class _Use(NamedTuple):
    """A precondition that names a state, where it is used."""

    key: str
    named: str
    others: Tuple[str, ...]  # the labels that it may name there
    place: str  # the path of the state that it is for

    def hint(self, paths: Set[str]) -> str:
        """Return ' (did you mean NAME?)', '' where nothing is close. `paths`: of the machine."""
        if '/' in self.named:
            return did_you_mean(self.named, paths | {'/' + each for each in paths})
        elsewhere = [
            each if '/' in each else '/' + each
            for each in sorted(paths)
            if each.rpartition('/')[2] == self.named
            and not (self.place + '/').startswith(each + '/')
        ]
        if elsewhere:
            return ' (did you mean {}?)'.format(' or '.join(elsewhere))
        return did_you_mean(self.named, self.others)


class SortedPreconditions(NamedTuple):
    """The preconditions that name no other state beside theirs, and those that do.

    `placed`: the key of each, and the name.
    """

    misplaced: List[SettingsError]
    placed: Set[Tuple[str, str]]


def sorted_preconditions(machine: smach.StateMachine, settings: Settings) -> SortedPreconditions:
    """Return which preconditions name another state beside the state that they are for.

    A label may occur in several nested machines: it is enough that the precondition fits one. A
    path has to be that of a state.
    """
    wrong: Dict[Tuple[str, str], _Use] = {}
    right: Set[Tuple[str, str]] = set()
    paths = set(_paths(machine, ''))
    for use in _uses(machine, settings, ''):
        if use.named in use.others or ('/' in use.named and use.named.lstrip('/') in paths):
            right.add(use[:2])
        else:
            wrong.setdefault(use[:2], use)
    return SortedPreconditions(
        [_misplaced(use, paths) for place, use in wrong.items() if place not in right], right
    )


def _misplaced(use: _Use, paths: Set[str]) -> SettingsError:
    return SettingsError(
        use.key,
        use.named,
        'the labels of the other states there: ' + ', '.join(use.others),
        problem='is not allowed' + use.hint(paths),
    )


def _uses(container: smach.Container, settings: Settings, path: str) -> Iterator[_Use]:
    children = _named_children(container)
    for label, state in children.items():
        below = '/'.join((path, label)) if path else label
        if isinstance(container, smach.StateMachine):
            others = tuple(sorted(other for other in children if other != label))
            for spec in settings.for_state(path, label).preconditions:
                key = below if 'preconditions' in settings.states.get(below, ()) else label
                for named in spec.labels():
                    yield _Use('states.{}.preconditions'.format(key), named, others, below)
        if settings.nested and isinstance(state, smach.Container):
            yield from _uses(state, settings, below)


def _paths(container: smach.Container, above: str) -> Iterator[str]:
    """Yield the paths of all states in a container."""
    for label, state in _named_children(container).items():
        path = '/'.join((above, label)) if above else label
        yield path
        if isinstance(state, smach.Container):
            yield from _paths(state, path)


def _named_children(container: smach.Container) -> Dict[str, smach.State]:
    """Return the states in a container that a setting can name."""
    children = children_of(container)
    return {label: state for label, state in children.items() if isinstance(label, str)}
