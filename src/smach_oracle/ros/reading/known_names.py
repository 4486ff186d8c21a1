"""The names that the machines of a process know, and what is done about one that a machine lacks.

One file of settings serves all machines of a script, and not each of them has every state.
"""

import gc
from typing import Any, Callable, Iterator, List, Mapping, Set

import smach
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.settings.failing_outcomes import name_text
from smach_oracle.oracle.settings.names import UnfitKind, UnfitName, matches

from .source_labels import is_in_sources


class Complaint:
    """Hands on a name that a machine does not have, with the place where it was set.

    A copy of the machine warns of such names (`strict=False`).
    """

    def __init__(
        self, decide: Callable[[UnfitName], None], located: Callable[[SettingsError], SettingsError]
    ) -> None:
        self._decide = decide
        self._located = located

    def __call__(self, unfit: UnfitName) -> None:
        """Have it decided."""
        self._decide(unfit._replace(error=self._located(unfit.error)))

    def __reduce__(self) -> Any:
        return bool, (False,)


class NameJudge:
    """Decides at the start of a machine about a name in the settings that it does not have.

    The name is an error if a state would run where its author forbids or limits it, and if no other
    machine has the name, or may get it later. Otherwise it is a warning, or nothing if another
    machine has it.

    :param may_refuse: whether nothing has moved yet.
    """

    def __init__(self, machine: smach.StateMachine, may_refuse: bool) -> None:
        self._machine = machine
        self._may_refuse = may_refuse

    def __call__(self, unfit: UnfitName) -> None:
        """Decide about a name.

        :raises SettingsError: where it is an error.
        """
        if unfit.kind in (UnfitKind.CHECKED, UnfitKind.GENERAL):
            return
        if unfit.kind is UnfitKind.PRECONDITION:
            smach.logwarn(str(unfit.error))
            return
        is_here = is_known(unfit.name, names_in(self._machine))
        is_elsewhere = is_known(unfit.name, names_of_others(self._machine))
        if (
            self._is_error(unfit, is_here)
            and not is_elsewhere
            and (is_here or not is_in_sources(unfit.name))
        ):
            raise unfit.error if is_here else with_way_out(unfit)
        if is_here or not is_elsewhere or unfit.kind is UnfitKind.MISPLACED:
            smach.logwarn('A machine of the script: {}'.format(unfit.error))

    def _is_error(self, unfit: UnfitName, is_here: bool) -> bool:
        if not self._may_refuse:
            return False
        return unfit.kind is UnfitKind.MISPLACED or (
            unfit.kind is UnfitKind.PROTECTION and not is_here
        )


def with_way_out(unfit: UnfitName) -> SettingsError:
    """Return the error of a name, with what to do if a machine that is made later has it."""
    return unfit.error.allowing(
        ', or a name of a machine that the script makes later: then write the name somewhere in '
        'the script, for example in a comment, # {}'.format(unfit.name)
    )


def is_known(name: str, names: Set[str]) -> bool:
    """Whether a label, path, pattern or outcome is one of these names, or stands for one."""
    plain = name.strip('/')
    return plain in names or '*' in plain and any(matches(plain, each) for each in names)


def names_of_others(machine: smach.StateMachine) -> Set[str]:
    """Return the names that the containers of this process know which are not in a machine."""
    own = {id(each) for each in containers_in(machine)}
    return {name for each in _containers() if id(each) not in own for name in names_in(each)}


def names_of_process() -> Set[str]:
    """Return the names that all containers of this process know."""
    return {name for each in _containers() for name in names_in(each)}


def names_in(container: smach.Container) -> Set[str]:
    """Return the labels, paths and outcomes of the states in a container, and its own outcomes."""
    found = set(map(str, container.get_registered_outcomes()))
    waiting = [('', container)]
    seen: List[smach.State] = []
    while waiting:
        above, each = waiting.pop()
        if any(each is other for other in seen):
            continue
        seen.append(each)
        for label, state in children_of(each).items():
            name = name_text(label)
            path = '/'.join((above, name)) if above else name
            found.update((name, path), map(str, state.get_registered_outcomes()))
            if isinstance(state, smach.Container):
                waiting.append((path, state))
    return found


def containers_in(container: smach.Container) -> Iterator[smach.Container]:
    """Yield a container and all containers in it."""
    yield container
    for state in children_of(container).values():
        if isinstance(state, smach.Container):
            yield from containers_in(state)


def children_of(container: smach.Container) -> Mapping[str, smach.State]:
    """Return the states by label. There are none where an Iterator has no contained state yet."""
    try:
        children = dict(container.get_children())
    except (AttributeError, TypeError, NotImplementedError):
        return {}
    return {label: state for label, state in children.items() if isinstance(state, smach.State)}


def _containers() -> List[smach.Container]:
    # by its type: a foreign object may answer anything for its __class__
    return [each for each in gc.get_objects() if issubclass(type(each), smach.Container)]
