"""Every machine that a checked script executes: it is checked, and not executed."""

import functools
import threading
from contextlib import ExitStack
from typing import Any, Callable, Iterable, Iterator, List, Sequence, Tuple, Type

import smach
from smach_oracle.oracle import OracleContainer, oracle_of
from smach_oracle.oracle.identity import own_mark
from smach_oracle.oracle.prospects import ContainerProspect, good_outcome, prospects_of
from smach_oracle.oracle.settings.names import Strictness
from smach_oracle.oracle.settings.settings import Settings

from ..container import take_parameters
from ..machine_names import machine_names
from .check_report import lines_of, wrapped
from .checked_names import CheckedNames
from .interception import MARK, family, machines_inside
from .machine_faults import MachineFaultError, faults_of, looking_at
from .precondition_labels import sorted_preconditions

# new machines of one structure after which a script is taken for one that builds them forever
MAX_ALIKE = 10


class MachineCheck:
    """Stands in for `execute` of every container, in any thread.

    :param wrap: puts a machine under an oracle as a real run does. A SettingsError is passed on.
    :param settings: those in force, for containers that are no state machines.
    :param tell: takes lines of text for people.
    :param why_left: says what to warn of where the program has wrapped a machine itself, ''
        for nothing.
    """

    def __init__(
        self,
        wrap: Callable[[smach.StateMachine], None],
        settings: Callable[[], Settings],
        tell: Callable[[List[str]], None],
        names: CheckedNames,
        why_left: Callable[[smach.StateMachine], str],
    ) -> None:
        self._wrap = wrap
        self._settings = settings
        self._tell = tell
        self._names = names
        self._why_left = why_left
        self._lock = threading.RLock()
        self._seen: List[smach.Container] = []  # the objects themselves, so that no id comes again
        self._told: List[Tuple[str, ...]] = []  # of each machine, except its name
        self.machines = 0  # of different structure
        self.warnings = 0

    def __call__(self, container: smach.Container) -> Any:
        """Check a container that is about to be executed, and return an outcome that is no failure.

        :raises StopIteration: where the script begins again.
        :raises SettingsError: where the settings do not fit.
        :raises MachineFaultError: where SMACH would refuse the container, or where it raises as it
            is looked at.
        """
        with self._lock:
            if any(container is each for each in self._seen):
                raise StopIteration('it executes a machine for the second time')
            self._seen.append(container)
            with looking_at(type(container).__name__):
                _refuse_faults(container)
                with ExitStack() as running:  # machines of a Concurrence run at the same time
                    for machine in list(_top_machines(container)):
                        self._check(machine, running)
                outcome = good_outcome(container, self._settings())
            self._tell(
                wrapped(
                    'It is not executed; the script goes on with {}.'.format(
                        'no outcome: all of them are failures'
                        if outcome is None
                        else 'the outcome {}'.format(outcome)
                    ),
                    0,
                )
                + ['']
            )
            return outcome

    def _warn(self, texts: Iterable[str]) -> None:
        for text in texts:
            self.warnings += 1
            self._tell(wrapped('Warning: ' + text, 0, 4))

    def _check(self, machine: smach.StateMachine, running: ExitStack) -> None:
        with _heard_warnings() as warnings:
            is_left = isinstance(machine, OracleContainer)
            if not is_left:
                self._wrap(machine)
            if not isinstance(machine, OracleContainer):  # those in it are top machines
                self.machines += 1
                self._warn(warnings)
                for each in list(_outermost_inside(machine)):
                    self._check(each, running)
                return
            name = _prepare(machine, running, self._names.complain)
            if is_left:
                warnings.extend(filter(None, [self._why_left(machine)]))
        self._names.note(sorted_preconditions(machine, oracle_of(machine).settings).placed)
        prospects = prospects_of(machine)
        told = _without_name(prospects, name)
        self._told.append(told)
        if self._told.count(told) > MAX_ALIKE:
            raise StopIteration('it builds machines of one structure again and again')
        if self._told.count(told) > 1:
            self._tell(wrapped('{}: another machine of the same structure.'.format(name), 0))
            return
        self.machines += 1
        for container in prospects:
            self._tell(lines_of(container) + [''])
        self._warn([*warnings, *map(str, faults_of(machine, name))])


def _refuse_faults(container: smach.Container) -> None:
    """Raise what makes SMACH refuse a container.

    :raises MachineFaultError: with a line for each fault.
    """
    try:
        is_refused = any(fault.is_certain for fault in faults_of(container, ''))
    except MachineFaultError:  # it says so again, by its name
        is_refused = True
    if is_refused:
        raise MachineFaultError(
            '\n'.join(
                str(fault)
                for fault in faults_of(container, _name_of(container))
                if fault.is_certain
            )
        )


def _name_of(container: smach.Container) -> str:
    """Return the name by which a container is reported."""
    if isinstance(container, OracleContainer):
        return oracle_of(container).path
    name = machine_names().name_of(container) if isinstance(container, smach.StateMachine) else ''
    return name or type(container).__name__


def _prepare(machine: OracleContainer, running: ExitStack, strict: Strictness) -> str:
    """Do what a real run does before the first state, and return the machine's name.

    :param running: as long as it is open, no other machine takes the name.
    :param strict: decides about names in the parameters that the machine does not have.
    :raises SettingsError: where the parameters of the node are wrong.
    """
    running.enter_context(machine_names().running(machine))
    take_parameters(machine, strict)
    return oracle_of(machine).path


def _without_name(prospects: Sequence[ContainerProspect], name: str) -> Tuple[str, ...]:
    """Return the report on a machine without its name, which is the same for machines alike."""
    return tuple(
        line for each in prospects for line in lines_of(each._replace(path=each.path[len(name) :]))
    )


class _heard_warnings:
    """Within it SMACH's warnings go into a list, in place of the log."""

    def __enter__(self) -> List[str]:
        self._before: Any = smach.logwarn
        self._heard: List[str] = []
        setattr(smach, 'logwarn', self._hear)
        return self._heard

    def _hear(self, text: str, *args: Any) -> None:
        self._heard.append(text % args if args else text)

    def __exit__(self, *error: object) -> None:
        setattr(smach, 'logwarn', self._before)


def _top_machines(container: smach.Container) -> Iterator[smach.StateMachine]:
    """The outermost machines in a container, itself among them."""
    if isinstance(container, smach.StateMachine):
        yield container
    else:
        yield from _outermost_inside(container)


def _outermost_inside(container: smach.Container) -> Iterator[smach.StateMachine]:
    nested: List[smach.StateMachine] = []
    for machine in machines_inside(container):  # each after those around it
        if not any(machine is each for each in nested):
            nested += machines_inside(machine)
            yield machine


def intercept(instead: Callable[[smach.Container], Any]) -> None:
    """Call this in place of `execute` of every container, present and future, for good."""
    for cls in family(smach.Container):
        _patch(cls, instead)
    inherited = smach.Container.__dict__.get('__init_subclass__')

    def __init_subclass__(cls: Type[smach.Container], **kwargs: Any) -> None:
        if inherited is not None:
            inherited.__get__(None, cls)(**kwargs)
        else:
            super(smach.Container, cls).__init_subclass__(**kwargs)
        _patch(cls, instead)

    setattr(smach.Container, '__init_subclass__', classmethod(__init_subclass__))


def _patch(cls: Type[smach.Container], instead: Callable[[smach.Container], Any]) -> None:
    original = cls.execute  # its own, or one that a mix-in brings
    if own_mark(original, MARK):
        return

    @functools.wraps(original)
    def execute(container: smach.Container, *args: Any, **kwargs: Any) -> Any:
        return instead(container)

    setattr(execute, MARK, True)
    setattr(cls, 'execute', execute)
