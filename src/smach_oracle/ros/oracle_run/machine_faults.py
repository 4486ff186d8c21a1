"""Finds what makes SMACH refuse a machine, at any depth, before anything runs.

SMACH says it late: a StateMachine when it is executed, a Concurrence when its outcome is looked up,
an Iterator at its first item.
"""

import inspect
from contextlib import contextmanager
from traceback import walk_tb
from types import TracebackType
from typing import (
    Any,
    Callable,
    Collection,
    Iterator,
    List,
    Mapping,
    NamedTuple,
    Optional,
    Tuple,
    Type,
)

import smach
from smach_common.foreign import error_text
from smach_oracle.oracle import OracleContainer, oracle_of
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.settings.names import did_you_mean

_ENGINE = ('smach', 'smach_ros', 'smach_common', 'smach_oracle')
# functions of SMACH that build machines
_BUILDING = (
    '__init__',
    '__enter__',
    '__exit__',
    'open',
    'close',
    'opened',
    'add',
    'add_auto',
    'set_contained_state',
    'set_iteritems',
    'check_consistency',
)


class MachineFaultError(Exception):
    """SMACH cannot run a machine. The text says which state is concerned, and why."""


def refused_while_built(
    kind: Optional[Type[BaseException]],
    error: Optional[BaseException],
    trace: Optional[TracebackType],
) -> Optional[Exception]:
    """Return the error where SMACH, or an oracle, has refused a machine that a script builds.

    It is None for all other errors.
    """
    if isinstance(error, (SettingsError, MachineFaultError)):
        return error
    frames = list(walk_tb(trace))
    of_engine = [
        (frame.f_code.co_name, number)
        for frame, number in frames
        if _package_of(frame.f_globals.get('__name__')) == 'smach'
    ]
    is_last = bool(frames) and _package_of(frames[-1][0].f_globals.get('__name__')) == 'smach'
    if error is None or not (is_last and any(name in _BUILDING for name, _ in of_engine)):
        return None
    place = _place_in_script(trace) or 'the script'
    # SMACH checks what is complete. Its KeyError does not say what is wrong
    built = [
        frame.f_locals.get('self')
        for frame, _ in frames
        if frame.f_code.co_name == 'check_consistency'
    ]
    try:
        faults = [
            str(fault)
            for each in built
            if isinstance(each, smach.Container)
            for fault in faults_of(each, type(each).__name__)
            if fault.is_certain
        ]
    except MachineFaultError as fault:
        faults = [str(fault)]
    why = faults or ['SMACH refuses the machine: {}'.format(' '.join(error_text(error).split()))]
    return MachineFaultError('\n'.join('{}: {}'.format(place, each) for each in dict.fromkeys(why)))


@contextmanager
def looking_at(path: str) -> Iterator[None]:
    """Say which container or state has raised as it was looked at, what, and where.

    :raises MachineFaultError: in place of any error of an author's own methods.
    """
    try:
        yield
    except (SettingsError, MachineFaultError, StopIteration):
        raise
    except Exception as err:
        place = _place_in_script(err.__traceback__)
        raise MachineFaultError(
            '{}: it cannot be checked, as it raises as it is looked at: {}{}'.format(
                path, ' '.join(error_text(err).split()), ' ({})'.format(place) if place else ''
            )
        ) from err


def _place_in_script(trace: Optional[TracebackType]) -> str:
    """Return where the script was last, or '' where it was in none of the frames."""
    of_script = [
        '{} line {}'.format(frame.f_code.co_filename, number)
        for frame, number in walk_tb(trace)
        if _package_of(frame.f_globals.get('__name__')) not in _ENGINE
    ]
    return of_script[-1] if of_script else ''


class MachineFault(NamedTuple):
    """One thing that is wrong: where, and what. `is_certain`: SMACH refuses it in any case."""

    path: str
    text: str
    is_certain: bool = True

    def __str__(self) -> str:
        return '{}: {}'.format(self.path, self.text)


def faults_of(container: smach.Container, path: str) -> List[MachineFault]:
    """Return what is wrong with a container and with all containers in it.

    :param path: what the container is called.
    :raises MachineFaultError: where a container or a state raises as it is looked at.
    """
    return list(_search(container, path, []))


def _search(container: Any, path: str, seen: List[Any]) -> Iterator[MachineFault]:
    if any(container is each for each in seen):
        return
    seen.append(container)
    with looking_at(path):
        children, executes_itself = _children(container), _executes_itself(container)
        found = list(_of_kind(container, path))
        if not children and not executes_itself:
            # a state may fill another container while it runs
            found.append(MachineFault(path, 'it has no states', is_certain=len(seen) == 1))
        for fault in found or _own_complaints(container, path):
            yield fault._replace(is_certain=fault.is_certain and not executes_itself)
        inside = [
            ('{}/{}'.format(path, label), state)
            for label, state in children.items()
            if isinstance(state, smach.Container)
        ]
    for its_path, state in inside:
        yield from _search(state, its_path, seen)


def _of_kind(container: Any, path: str) -> Iterator[MachineFault]:
    kinds: Tuple[Tuple[type, Callable[[Any, str], Iterator[MachineFault]]], ...] = (
        (smach.StateMachine, _of_machine),
        (smach.Concurrence, _of_concurrence),
        (smach.Iterator, _of_iterator),
    )
    for kind, search in kinds:
        if isinstance(container, kind):
            yield from search(container, path)


def _of_machine(machine: Any, path: str) -> Iterator[MachineFault]:
    """Yield the transitions of a StateMachine or Sequence that lead nowhere."""
    states = _children(machine)
    outcomes = set(machine.get_registered_outcomes())
    initial = machine._initial_state_label
    if initial not in states and (states or initial is not None):
        yield MachineFault(
            path,
            'its initial state is {}, which is none of its states; they are {}'.format(
                initial, _names(states)
            ),
        )
    for label, state in states.items():
        drawn = machine._transitions.get(label)
        if drawn is None:  # it is shown, and is no state
            continue
        for outcome, target in drawn.items():
            why = _why_nowhere(outcome, target, path, states, outcomes)
            if why:
                yield MachineFault(
                    '{}/{}'.format(path, label), 'its outcome {!r} {}'.format(outcome, why)
                )
        for outcome in _outcomes_of(state, '{}/{}'.format(path, label)):
            if outcome not in drawn:
                yield MachineFault(
                    '{}/{}'.format(path, label),
                    'its outcome {!r} was registered '
                    'after it was added, and has no transition'.format(outcome),
                    False,
                )


def _why_nowhere(
    outcome: Any, target: Any, path: str, states: Collection[Any], outcomes: Collection[Any]
) -> str:
    """Return why a transition of a machine leads nowhere, or '' where it leads somewhere."""
    if target and target not in states and target not in outcomes:
        return (
            'leads to {!r}, which is no state or outcome of {}{}; there are the states {} and '
            'the outcomes {}'.format(
                target, path, _close(target, [*states, *outcomes]), _names(states), _names(outcomes)
            )
        )
    if not target and outcome not in outcomes:
        return 'leads to no state, and is no outcome of {}{}; its outcomes are {}'.format(
            path, _close(outcome, outcomes), _names(outcomes)
        )
    return ''


def _of_concurrence(concurrence: Any, path: str) -> Iterator[MachineFault]:
    """Yield the entries of an outcome map that no branch, and no outcome, fits."""
    states, outcomes = concurrence.get_children(), concurrence.get_registered_outcomes()
    if concurrence._default_outcome not in outcomes:
        yield MachineFault(
            path,
            'its default outcome '
            + _is_none_of(concurrence._default_outcome, 'outcomes', outcomes),
        )
    for outcome, conditions in _entries(concurrence._outcome_map):
        if outcome not in outcomes:
            yield MachineFault(
                path, 'its outcome map leads to ' + _is_none_of(outcome, 'outcomes', outcomes)
            )
        for label, wanted in _entries(conditions):
            if label not in states:
                yield MachineFault(
                    path,
                    'its outcome map waits for the state ' + _is_none_of(label, 'states', states),
                )
                continue
            registered = _outcomes_of(states[label], '{}/{}'.format(path, label))
            if wanted not in registered:
                yield MachineFault(
                    '{}/{}'.format(path, label),
                    'the outcome map of {} waits for its outcome '
                    '{!r}, which it does not have{}; its outcomes are {}'.format(
                        path, wanted, _close(wanted, registered), _names(registered)
                    ),
                    False,
                )


def _of_iterator(iterator: Any, path: str) -> Iterator[MachineFault]:
    """Yield the ends of an Iterator that are no outcome of it."""
    outcomes = iterator.get_registered_outcomes()
    ends = iterator._final_outcome_map
    for end in ends.values():
        if end not in outcomes:
            yield MachineFault(
                path,
                'its final outcome map leads to ' + _is_none_of(end, 'outcomes', outcomes),
                False,
            )
    for outcome in iterator._break_outcomes:
        if outcome not in ends and outcome not in outcomes:
            yield MachineFault(
                path, 'it would end in ' + _is_none_of(outcome, 'outcomes', outcomes), False
            )


def _is_none_of(name: Any, what: str, names: Collection[Any]) -> str:
    return '{!r}, which is none of its {}{}; they are {}'.format(
        name, what, _close(name, names), _names(names)
    )


def _own_complaints(container: Any, path: str) -> Iterator[MachineFault]:
    """Yield what a container says of itself that nothing else has found."""
    if not _children(container):
        return
    try:
        container.check_consistency()
    except NotImplementedError:
        pass
    except Exception as err:  # an author's own check may raise anything
        yield MachineFault(path, 'SMACH refuses it: {}'.format(' '.join(error_text(err).split())))


def _children(container: Any) -> Mapping[Any, Any]:
    """Return the states in a container by label, the oracle's own state not among them."""
    try:
        children = dict(container.get_children())
    except (AttributeError, TypeError, NotImplementedError):
        return {}
    meta = (
        oracle_of(container).settings.oracle_label
        if isinstance(container, OracleContainer) and oracle_of(container).recovers
        else None
    )
    return {
        label: state for label, state in children.items() if state is not None and label != meta
    }


def _outcomes_of(state: Any, path: str) -> Collection[Any]:
    with looking_at(path):
        return tuple(state.get_registered_outcomes())


def _executes_itself(container: Any) -> bool:
    """Whether an author's own `execute` may build what is in the container."""
    execute = inspect.unwrap(type(container).execute)
    return _package_of(execute.__module__) not in _ENGINE


def _package_of(module: Optional[str]) -> str:
    return (module or '').split('.')[0]


def _entries(conditions: Any) -> List[Tuple[Any, Any]]:
    return list(conditions.items()) if isinstance(conditions, Mapping) else []


def _close(name: Any, names: Collection[Any]) -> str:
    return did_you_mean(str(name), map(str, names))


def _names(names: Collection[Any]) -> str:
    return ', '.join(sorted(map(str, names))) or 'none'
