"""Makes the preconditions of a state hold (paper, IV-B).

They read and write the container's userdata through a gate. A state of the tree keeps its own time
limit. All else has that of the state whose preconditions they are. Their runs do not count as
visits. A state of another container runs on the userdata of that one. The containers on the way
down to it get their input keys, as if they began. Once it has ended well, what it wrote goes up
through their output keys, and down through the input keys of the containers around the failed
state.
"""

from typing import Dict, List, Set, Tuple, Union, cast

import smach
from smach_common.foreign import repr_of

from ..identity import truth_of
from ..machine.places import (
    JumpPath,
    TreePlace,
    hand_down,
    hand_on,
    hand_up,
    jump_path_to,
    links_to,
    place_named,
    why_unfit,
)
from ..machine.repeats import note_precondition, repeated_by_running
from ..machine.site import judged_at
from ..machine.userdata import UserdataGate, WriteWatch, behind, view_behind, write_constants
from ..machine.workers import Overrun
from ..records.events import FailureKind
from ..settings.failing_outcomes import is_preempted, name_text
from ..settings.preconditions import PreconditionKind, PreconditionSpec
from ..settings.settings import ALLOW, RUN
from ..smach_private import constants_of, data_of, is_executing, states_of
from .failure import is_registered
from .operator_wait import wait_for_operator
from .recovery import Recovery


class NotMet(Exception):
    """A precondition is not met. The text says why. This error never leaves its module."""


def why_not_met(recovery: Recovery, spec: PreconditionSpec) -> str:
    """Make a precondition hold. Return '' where it is met, else why not.

    What an unmet one wrote is taken back.
    """
    begun = recovery.watch.begin()
    elsewhere: List[_Elsewhere] = []
    try:
        _achieve(recovery, spec, elsewhere)
    except NotMet as why:
        for each in reversed(elsewhere):
            each.take_back()
        recovery.watch.take_back(begun)
        return str(why)
    return ''


def _achieve(recovery: Recovery, spec: PreconditionSpec, elsewhere: 'List[_Elsewhere]') -> None:
    if spec.kind is PreconditionKind.PAIR:
        check, achieve = spec.target
        try:
            _achieve(recovery, check, elsewhere)
        except NotMet:
            _achieve(recovery, achieve, elsewhere)  # it may need what the check has found
    elif spec.kind is PreconditionKind.CALLABLE:
        _call(recovery, spec)
    elif spec.kind is PreconditionKind.STATE:
        _run(recovery, TreePlace(recovery.node, ''), spec.target, recovery.watch.gate)
    else:
        _run_place(recovery, spec.target, elsewhere)


def _call(recovery: Recovery, spec: PreconditionSpec) -> None:
    name, node, scope = spec.name, recovery.node, recovery.scope
    wait_for_operator(node, (), name, RUN, scope)
    _check_free(recovery, spec.target)
    gate, settings = recovery.watch.gate.fork(), recovery.record.settings
    try:
        result = node.tree.workers.call(spec.target, behind(gate), gate, settings, scope)
    except Exception as err:
        raise NotMet('{} {}'.format(name, _raised(recovery, name, err))) from err
    if isinstance(result, Overrun):
        raise NotMet('{} {}'.format(name, result.text))
    if result is None:
        raise NotMet('{} returned None; True is met'.format(name))
    if not truth_of(result):
        raise NotMet('{} returned {}'.format(name, repr_of(result)))


def _raised(recovery: Recovery, name: str, err: Exception) -> str:
    """Return what a precondition raised. The log says so: it may be a mistake in a program."""
    text = 'raised {}'.format(repr_of(err))
    if recovery.scope.told is None:
        place = '/'.join((recovery.node.path, recovery.record.label))
        smach.logwarn('{}: precondition {} {}: it is not met'.format(place, name, text))
    return text


def _check_free(recovery: Recovery, target: object) -> None:
    """Check that a state or a function may be entered now.

    :raises NotMet: where it may not.
    """
    if recovery.scope.told is not None:
        raise NotMet('preempted')
    blocked = recovery.node.tree.workers.blocked(target)
    if blocked:
        raise NotMet(blocked)


def _run_place(recovery: Recovery, name: str, elsewhere: 'List[_Elsewhere]') -> None:
    """Run the state of this name, in the container itself or in another one."""
    node = recovery.node
    place = place_named(node, name)
    why_not = why_unfit(node, '', name) if '/' in name else ''
    if place is None or why_not:
        raise NotMet('{!r} cannot be run: {}'.format(name, why_not or 'there is no such state'))
    state = states_of(place.node.machine)[place.label]
    if place.node is node:
        _run(recovery, place, state, recovery.watch.gate)
        return
    run = _Elsewhere(recovery, place)
    elsewhere.append(run)
    _run(recovery, place, state, run.gate)
    run.hand_over()


def _run(recovery: Recovery, place: TreePlace, state: smach.State, gate: UserdataGate) -> None:
    """Execute a state of a container, and note that.

    :param place: its label is '' where the state was given itself.
    :param gate: what its userdata is written through.

    :raises NotMet: where it, or a state within, would be repeated and is not to be.
    """
    node, states = place.node, states_of(place.node.machine)
    noted = place.label or next((label for label in node.labels() if states[label] is state), '')
    if noted:
        repeated = repeated_by_running(node, noted)
        if repeated:
            raise _not_repeated(', '.join(repeated))
        _check_free(recovery, states[noted])
        note_precondition(node, noted)
    try:
        _judge(recovery, place, state, _execute(recovery, place, state, gate))
    finally:
        if noted:
            note_precondition(node, noted)


def _not_repeated(what: str) -> NotMet:
    return NotMet('{} was done in this trial and is not repeated by itself'.format(what))


def _execute(
    recovery: Recovery, place: TreePlace, state: smach.State, gate: UserdataGate
) -> object:
    scope, origin, (node, label) = recovery.scope, recovery.origin, place
    settings = node.settings_of(label) if label else recovery.record.settings
    autonomy = settings.autonomy if label else RUN
    wait_for_operator(node, (), label or type(state).__name__, autonomy, scope)
    _check_free(recovery, state)
    if not node.tree.begin_precondition(node, state):
        raise NotMet('is being run as a precondition already')
    try:
        with origin.lock:
            if scope.told is not None:
                return None  # who judges it sees the stop
            origin.running = state
        if label:
            write_constants(behind(gate), constants_of(node.machine, label))
        gate = gate if settings.time_limit_s is None else gate.fork()
        view = view_behind(gate, node.machine, label, state)
        if settings.time_limit_s is None:
            return state.execute(view)
        return node.tree.workers.run(state, view, gate, label, settings)
    except Exception as err:
        raise NotMet(_raised(recovery, label or type(state).__name__, err)) from err
    finally:
        node.tree.end_precondition(node, state)
        with origin.lock:
            origin.running = None
            cancelled = scope.told is not None
        if cancelled:
            state.recall_preempt()  # the meta state services the request in its place


def _judge(recovery: Recovery, place: TreePlace, state: smach.State, outcome: object) -> None:
    if isinstance(outcome, Overrun):
        raise NotMet(outcome.text)
    if recovery.scope.told is not None:
        raise NotMet('preempted')
    if not is_registered(state, outcome):
        raise NotMet('returned {}, which is not one of its outcomes'.format(repr_of(outcome)))
    outcome, node = cast('str', outcome), place.node
    if place.label:
        failed = judged_at(node, place.label, outcome)[1] not in (
            FailureKind.NOT_A_FAILURE,
            FailureKind.UNREGISTERED_OUTCOME,
        )
    else:
        listed = node.settings.defaults.failure_outcomes
        failed = outcome in node.in_force.failing or name_text(outcome) in listed
    if failed or is_preempted(outcome):
        raise NotMet('ended with {!r}'.format(outcome))


# -- in another container


class _Elsewhere:
    """One run of a state of another container than that of the failed state."""

    def __init__(self, recovery: Recovery, place: TreePlace) -> None:
        """:raises NotMet: where the state cannot be run now."""
        way = jump_path_to(recovery.node, place)
        if way is None:  # its machine lies in two containers, and the other one has adopted it
            raise NotMet('{} is in no container that is being executed'.format(place.path))
        _check(way)
        self._own = recovery.watch.gate
        self._userdata = recovery.node.machine.userdata
        self._down = [link for below in way.entered_places[1:] for link in links_to(below.node)]
        self._on = [link for left in reversed(way.left_containers) for link in links_to(left)]
        # whether its container is one around the failed state
        self._runs = not way.entered_places[1:]
        self._watch = WriteWatch(place.node.machine, place.node.in_force.deep_copy_keys)
        self._begun = self._watch.begin()
        self.gate = self._watch.gate
        # what was there in each container, and the keys that it got
        self._handed_down: List[Tuple[Dict[str, object], Dict[str, object], Set[str]]] = []
        for link in self._down:
            data = data_of(link.inner_container.userdata)
            self._handed_down.append((data, dict(data), hand_down(link)))

    def take_back(self) -> None:
        """Make the userdata what it was."""
        if self._runs:
            self._watch.take_back_own(self._begun)
            return
        self._watch.take_back(self._begun)
        for data, before, handed in self._handed_down:
            for key in handed:
                if key in before:
                    data[key] = before[key]
                else:
                    data.pop(key, None)

    def hand_over(self) -> None:
        """Hand what the state wrote to the container of the failed state, as its author says."""
        written = set(self.gate.written)
        for link in reversed(self._down):
            written = hand_up(link, written, self._writer_of(link.outer_container))
        for link in self._on:
            written = hand_on(link, written, self._writer_of(link.inner_container))

    def _writer_of(self, container: smach.Container) -> Union[UserdataGate, smach.UserData]:
        return self._own if container.userdata is self._userdata else container.userdata


def _check(way: JumpPath) -> None:
    for place in way.entered_places[1:]:
        if is_executing(place.node.machine):
            raise NotMet('{} runs at this time'.format(place.node.path))
    for place in way.entered_places[:-1]:
        guarded = place.node.settings_of(place.label).on_retry != ALLOW
        if guarded and place.node.records.marks[place.label].done:
            raise _not_repeated(place.path)
