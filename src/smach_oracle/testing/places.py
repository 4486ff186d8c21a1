"""The states of a machine, at any depth, by the names that tests give them."""

from difflib import get_close_matches
from typing import Dict, Iterable, Iterator, List, NamedTuple, Tuple

import smach
from smach_oracle.oracle import OracleContainer, oracle_of

from .errors import FaultError


class StatePlace(NamedTuple):
    """One state under one label."""

    path: str  # the labels that lead to it, below the top machine: KITCHEN/PICK
    label: str
    container: smach.Container
    state: smach.State

    @property
    def is_container(self) -> bool:
        """Whether it holds states itself."""
        return isinstance(self.state, smach.Container)

    def visited_now(self) -> bool:
        """Whether an execution that begins now is a visit of this place.

        It is not one where a precondition runs the state, or the same object under another label.
        """
        container = self.container
        return not isinstance(container, smach.StateMachine) or (
            container._current_label == self.label
        )


def places_of(machine: smach.Container) -> List[StatePlace]:
    """Return the states of a container and of all containers in it, the outer ones first."""
    return list(_places_in(machine, '', (machine,)))


def _places_in(
    container: smach.Container, above: str, around: Tuple[smach.Container, ...]
) -> Iterator[StatePlace]:
    for label, state in _children(container).items():
        path = '{}/{}'.format(above, label) if above else str(label)
        yield StatePlace(path, label, container, state)
        if isinstance(state, smach.Container) and not any(state is each for each in around):
            yield from _places_in(state, path, around + (state,))


def _children(container: smach.Container) -> Dict[str, smach.State]:
    meta = ''
    if isinstance(container, OracleContainer) and oracle_of(container).recovers:
        meta = oracle_of(container).settings.oracle_label
    return {
        label: state
        for label, state in container.get_children().items()
        if isinstance(state, smach.State) and (not meta or label != meta)
    }


def find_place(places: List[StatePlace], name: str, what: str) -> StatePlace:
    """Return the place that a LABEL or PATH/LABEL names. `what` asks, for the error.

    The path is relative to the top machine. Its own name may stand before it.

    :raises FaultError: where there is no such state, or where there are several.
    """
    __tracebackhide__ = True
    found = [place for place in places if place.path == name]
    found = found or [place for place in places if place.label == name]
    found = found or [
        place for place in places if '/' in name and place.path == name.split('/', 1)[1]
    ]
    if len(found) == 1:
        return found[0]
    if found:
        raise FaultError(
            '{}: {!r} is the label of {} states; say which: {}'.format(
                what, name, len(found), ', '.join(place.path for place in found)
            )
        )
    known = [each for place in places for each in (place.path, place.label)]
    raise FaultError(
        '{}: there is no state {!r}{}; there are {}'.format(
            what,
            name,
            did_you_mean(name, known),
            ', '.join(place.path for place in places) or 'none',
        )
    )


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return a question about the known name that is most like another one, '' for none."""
    by_capitals = {each.upper(): each for each in known}
    likely = get_close_matches(name.upper(), by_capitals, 1)
    return ' (did you mean {!r}?)'.format(by_capitals[likely[0]]) if likely else ''
