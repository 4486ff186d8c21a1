"""The OracleContainer of ROS programs: the bare one, attached to the node it runs in.

Building and wrapping need no node. At its first execute in a process that has called
rospy.init_node, a top-level machine gets its settings from the parameter `~oracle` as well, an
expert (action server `~expert_query`, or the one that `~expert_query_server` names), the topics
`~oracle/events` and `~oracle/rates`, an introspection server (`~introspection`, default true) and a
recorder (`~record`: folder, `~record_topics`: list). Without a node it behaves as the bare one.
"""

import functools
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Iterator, Mapping, NamedTuple, Optional, Sequence

import rospy

import smach
from smach_oracle.oracle import oracle_of
from smach_oracle.oracle.asking.question import Expert
from smach_oracle.oracle.container import OracleContainer as BareContainer
from smach_oracle.oracle.container import SettingsLike
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.identity import WeakIdentityMap
from smach_oracle.oracle.settings.health import HealthFunction
from smach_oracle.oracle.settings.names import Nested, Strictness
from smach_oracle.oracle.settings.settings import PreconditionLists, Settings
from smach_oracle.oracle.under_way import is_stepping, under_way

from .expert.failure_text import describe_failure
from .loaded_settings import (
    DEFAULT_PARAM,
    LoadedSettings,
    read_checkpoint,
    read_param,
    resolve_python,
)
from .log.said_once import SaidOnce
from .machine_names import machine_names
from .main_thread import outside_main_thread
from .reading.known_names import Complaint

if TYPE_CHECKING:
    from .attachment import Attachments


class _GivenSettings(NamedTuple):
    """The settings that a machine was given in code, kept until the parameters are merged in."""

    settings: Optional[Mapping[str, Any]]
    preconditions: PreconditionLists
    nested: Optional[Nested]


# a script may build a machine for each trial
_tell_once = SaidOnce(lambda text: rospy.loginfo('%s', text))
_given: WeakIdentityMap[BareContainer, _GivenSettings] = WeakIdentityMap()


class OracleContainer(BareContainer):
    """A `smach.StateMachine` with an ORACLE state, attached to its ROS node.

    Settings given as a dictionary lie under the parameter `~oracle`. A `Settings` object is taken
    as it is.
    """

    def __init__(
        self,
        outcomes: Sequence[str],
        input_keys: Sequence[str] = (),
        output_keys: Sequence[str] = (),
        *,
        settings: SettingsLike = None,
        preconditions: PreconditionLists = None,
        name: str = '',
        expert: Optional[Expert] = None,
        recover: bool = True,
        strict: Strictness = True,
        health: Optional[HealthFunction] = None,
    ) -> None:
        """See `smach_oracle.oracle.OracleContainer`.

        :raises SettingsError: naming key, value and what is allowed.
        """
        super().__init__(
            outcomes,
            input_keys,
            output_keys,
            settings=checked(settings, preconditions),
            name=name,
            expert=expert,
            recover=recover,
            strict=strict,
            health=health,
        )
        _remember(self, settings, preconditions, None)
        _tell_of_ros(self)

    @classmethod
    def wrap(
        cls,
        machine: smach.StateMachine,
        preconditions: PreconditionLists = None,
        settings: SettingsLike = None,
        nested: Optional[Nested] = None,
        name: str = '',
        expert: Optional[Expert] = None,
        strict: Strictness = True,
        recover: bool = True,
        health: Optional[HealthFunction] = None,
    ) -> 'OracleContainer':
        """Put a machine under an oracle and return it: the same object.

        See `smach_oracle.oracle.OracleContainer.wrap`.

        :raises SettingsError: naming key, value and what is allowed.
        """
        wrapped: OracleContainer = super().wrap(  # type: ignore[assignment]
            machine,
            settings=checked(settings, preconditions),
            nested=nested,
            name=name,
            expert=expert,
            strict=strict,
            recover=recover,
            health=health,
        )
        _remember(wrapped, settings, preconditions, nested)
        _tell_of_ros(wrapped)
        return wrapped

    def execute(self, *args: object, **kwargs: object) -> Optional[str]:
        """Run the machine. A top-level one is attached to its node first.

        :raises SettingsError: where the parameters of the node are wrong.
        :raises CheckpointError: where the store that `checkpoint` names cannot be used.
        :raises OSError: where the folder for the bags cannot be made or written.
        """
        oracle = oracle_of(self)
        if not oracle.is_top or is_stepping(self) or oracle.is_parents:
            return super().execute(*args, **kwargs)
        _tell_of_ros(self)
        with under_way(self), _attached(self, self):
            return super().execute(*args, **kwargs)


def _tell_of_ros(machine: OracleContainer) -> None:
    """Have a machine describe failures of actions, and attach it where one in it begins a trial."""
    oracle = oracle_of(machine)
    if oracle.is_top:
        oracle.describe_failure = describe_failure
        oracle.around_nested_trial = functools.partial(_attached, machine)


@contextmanager
def _attached(top: OracleContainer, machine: smach.StateMachine) -> Iterator[None]:
    """Attach the top machine of a trial to its node, for a trial of `machine` in the body."""
    attachments = _attachments()
    with attachments.refusing(), machine_names().running(top):
        if not attachments.has_parents_node:
            _attach(top)
        attachments.begins(top)
        with attachments.trial(machine):
            yield


def _attach(machine: OracleContainer) -> None:
    try:
        take_parameters(machine)
        if not _attachments().shows(machine):
            outside_main_thread(functools.partial(_attachments().attach, machine))
    except rospy.ROSInterruptException as err:
        # as a bare machine, it runs and finds the shutdown itself
        rospy.logwarn('%s is not attached to its node: %s', oracle_of(machine).path, err)


def _attachments() -> 'Attachments':
    """Return those of this process. A program that executes no machine does not import them."""
    from .attachment import attachments

    return attachments()


def checked(settings: SettingsLike, preconditions: PreconditionLists = None) -> Settings:
    """Return settings with all names of Python objects resolved.

    :raises SettingsError: naming key, value and what is allowed, and where the key was set if that
        is known.
    """
    try:
        result = (
            settings
            if isinstance(settings, Settings)
            else Settings.from_dict(settings, resolve_python)
        )
    except SettingsError as err:
        raise (settings.located(err) if isinstance(settings, LoadedSettings) else err) from err
    if preconditions is None:
        return result
    if not isinstance(preconditions, Mapping):
        raise SettingsError('preconditions', preconditions, 'a mapping of state labels to lists')
    return result.with_states(
        {label: {'preconditions': given} for label, given in preconditions.items()}, resolve_python
    )


def _remember(
    machine: BareContainer,
    settings: SettingsLike,
    preconditions: PreconditionLists,
    nested: Optional[Nested],
) -> None:
    if isinstance(settings, Settings):
        _given.forget(machine)
    else:
        _given[machine] = _GivenSettings(settings, preconditions, nested)


def take_parameters(machine: BareContainer, strict: Strictness = False) -> None:
    """Merge the parameter `~oracle` over what the machine was given in code.

    Once, and only in a node. By default it is not strict: one parameter serves every machine of the
    node, and not each of them has every state.

    :raises SettingsError: naming key, value and what is allowed.
    :raises rospy.ROSInterruptException: where the node shuts down meanwhile.
    """
    given = _given.get(machine)
    if given is None or not rospy.core.is_initialized():
        return
    # Python objects that they name are looked up in this thread: a module may be imported for it
    parameters = outside_main_thread(functools.partial(read_param, DEFAULT_PARAM))
    checkpoint = outside_main_thread(read_checkpoint)
    if parameters.values or checkpoint.values:
        settings = LoadedSettings(given.settings)
        for source in (parameters, checkpoint):
            for change in settings.overridden_by(source.values):
                _tell_once(
                    '{}: the {} overrides {}'.format(oracle_of(machine).path, source.origin, change)
                )
            settings.put(*source)
        complain: Strictness = strict
        if callable(strict):
            complain = Complaint(strict, settings.located)
        BareContainer.wrap(
            machine,
            settings=checked(settings, given.preconditions),
            nested=given.nested,
            strict=complain,
            recover=oracle_of(machine).recovers,
        )
    _given.forget(machine)  # only now: a program that tries again after an error gets it again
