"""Makes the preconditions of a state hold (paper, IV-B).

Runs of preconditions do not count as visits.
"""

import contextlib
import threading
from typing import Any, Iterator, List, NamedTuple, Optional

import smach
from smach_common.foreign import repr_of

from ..identity import truth_of
from ..machine.places import place_named, why_unfit
from ..machine.repeats import note_precondition, repeated_by_running
from ..machine.site import failure_kind, route_of
from ..machine.snapshots import UserdataGate, WriteWatch, behind
from ..machine.tree_node import TreeNode
from ..machine.userdata_view import constants_of, view_behind, write_constants
from ..records.events import FailureKind
from ..scope.scope import Scope
from ..settings.failing_outcomes import is_preempted
from ..settings.preconditions import PreconditionKind, PreconditionSpec
from ..settings.settings import RUN, StateSettings
from .failure import is_registered
from .operator_wait import wait_for_operator
from .precondition_elsewhere import NotMet, RunElsewhere


class _RunIn(NamedTuple):
    """A container of which a state is run, and what its userdata is written through."""

    node: TreeNode
    gate: UserdataGate


class PreconditionRunner:
    """Runs the preconditions of one failure, one after the other.

    They read and write the container's userdata through a gate. A state of the tree keeps its own
    time limit. All else has that of the state whose preconditions they are.

    `cancel` may be called from any thread, at any time: the state that runs is preempted, a
    function that runs is left behind, nothing more begins.
    """

    def __init__(
        self, node: TreeNode, settings: StateSettings, watch: WriteWatch, scope: Scope
    ) -> None:
        """`settings`: of the state whose preconditions are to be run. `scope`: of the recovery."""
        self._settings = settings
        self._node = node
        self._watch = watch
        self._gate = watch.gate
        self._own = _RunIn(node, watch.gate)
        self._elsewhere: List[RunElsewhere] = []
        self._lock = threading.Lock()
        self._running: Optional[Any] = None
        self._scope = scope

    def cancel(self) -> None:
        """Preempt what runs, once the scope is cancelled, which lets nothing more begin."""
        with self._lock:
            running = self._running
        if running is not None:
            running.request_preempt()

    def run(self, spec: PreconditionSpec) -> str:
        """Return '' where the precondition is met, else why not.

        What an unmet one wrote is taken back.
        """
        begun = self._watch.begin()
        self._elsewhere = []
        try:
            self._achieve(spec)
        except NotMet as why:
            for each in reversed(self._elsewhere):
                each.take_back()
            self._watch.take_back(begun)
            return str(why)
        return ''

    def _achieve(self, spec: PreconditionSpec) -> None:
        if spec.kind is PreconditionKind.PAIR:
            check, achieve = spec.target
            try:
                self._achieve(check)
            except NotMet:
                self._achieve(achieve)  # it may need what the check has found
        elif spec.kind is PreconditionKind.CALLABLE:
            self._call(spec)
        elif spec.kind is PreconditionKind.STATE:
            with self._noted(self._own, self._label_of(spec.target)):
                self._judge(self._own, spec.target, '', self._execute(self._own, spec.target, ''))
        else:
            self._run_label(spec.target)

    def _wait_for_operator(self, node: TreeNode, name: str, label: str = '') -> None:
        """Wait where an operator holds the tree. `label`: of a state of the container."""
        autonomy = node.settings_of(label).autonomy if label else RUN
        wait_for_operator(node, (), name, autonomy, self._scope)

    def _call(self, spec: PreconditionSpec) -> None:
        self._wait_for_operator(self._node, spec.name)
        self._check_free(spec.target)
        gate = self._gate.fork()
        ended = self._node.tree.workers.call(
            spec.target,
            behind(gate),
            gate,
            self._settings.time_limit_s,
            self._settings.grace_period_s,
            self._scope,
        )
        if isinstance(ended.error, Exception):
            raise NotMet('{} raised {}'.format(spec.name, repr_of(ended.error))) from ended.error
        if ended.error is not None:
            raise ended.error
        if ended.overrun:
            raise NotMet('{} {}'.format(spec.name, ended.overrun))
        result = ended.outcome
        if result is None:
            raise NotMet('{} returned None; True is met'.format(spec.name))
        if not truth_of(result):
            raise NotMet('{} returned {}'.format(spec.name, repr_of(result)))

    def _check_free(self, target: object) -> None:
        """Check that a state or a function may be entered now.

        :raises NotMet: where it may not.
        """
        if self._scope.told is not None:
            raise NotMet('preempted')
        blocked = self._node.tree.workers.blocked(target)
        if blocked:
            raise NotMet(blocked)

    def _run_label(self, name: str) -> None:
        place = place_named(self._node, name)
        why_not = why_unfit(self._node, '', name) if '/' in name else ''
        if place is None or why_not:
            raise NotMet('{!r} cannot be run: {}'.format(name, why_not or 'there is no such state'))
        if place.node is self._node:
            self._run_in(self._own, place.label)
            return
        elsewhere = RunElsewhere(self._node, place, self._gate)
        self._elsewhere.append(elsewhere)
        self._run_in(_RunIn(place.node, elsewhere.gate), place.label)
        elsewhere.hand_over()

    def _run_in(self, site: _RunIn, label: str) -> None:
        state = site.node.machine._states[label]
        with self._noted(site, label):
            self._judge(site, state, label, self._execute(site, state, label))

    def _label_of(self, state: smach.State) -> str:
        """Return the label of a state that was given itself, '' where the container has it not."""
        return next(
            (label for label in self._node.labels() if self._node.machine._states[label] is state),
            '',
        )

    @contextlib.contextmanager
    def _noted(self, site: _RunIn, label: str) -> Iterator[None]:
        """Note that a state of the container is executed.

        :raises NotMet: where it, or a state within, would be repeated and is not to be.
        """
        repeated = repeated_by_running(site.node, label) if label else ()
        if repeated:
            raise NotMet(
                '{} was done in this trial and is not repeated by itself'.format(
                    ', '.join(repeated)
                )
            )
        if label:
            self._check_free(site.node.machine._states[label])
            note_precondition(site.node, label)
        try:
            yield
        finally:
            if label:
                note_precondition(site.node, label)

    def _execute(self, site: _RunIn, state: smach.State, label: str) -> object:
        self._wait_for_operator(site.node, label or type(state).__name__, label)
        self._check_free(state)
        with self._lock:
            if self._scope.told is not None:
                raise NotMet('preempted')
            self._running = state
        if not site.node.tree.begin_precondition(site.node, state):
            self._running = None
            raise NotMet('is being run as a precondition already')
        try:
            if label:
                write_constants(behind(site.gate), constants_of(site.node.machine, label))
            return self._with_limit(site, state, label)
        except NotMet:
            raise
        except Exception as err:
            raise NotMet('raised {}'.format(repr_of(err))) from err
        finally:
            site.node.tree.end_precondition(site.node, state)
            self._ended(state)

    def _with_limit(self, site: _RunIn, state: smach.State, label: str) -> object:
        machine, settings = site.node.machine, self._settings
        if label:
            settings = site.node.settings_of(label)
        if settings.time_limit_s is None:
            return state.execute(view_behind(site.gate, machine, label, state))
        gate = site.gate.fork()
        result = self._node.tree.workers.run(
            state,
            view_behind(gate, machine, label, state),
            gate,
            label,
            settings.time_limit_s,
            settings.grace_period_s,
        )
        if result.error is not None:
            raise result.error
        if result.overrun:
            raise NotMet(result.overrun)
        return result.outcome

    def _ended(self, state: smach.State) -> None:
        with self._lock:
            self._running = None
            cancelled = self._scope.told is not None
        if cancelled and not self._node.tree.workers.blocked(state):
            state.recall_preempt()  # the meta state services the request in its place

    def _judge(self, site: _RunIn, state: smach.State, label: str, outcome: Any) -> None:
        if self._scope.told is not None:
            raise NotMet('preempted')
        if not is_registered(state, outcome):
            raise NotMet('returned {}, which is not one of its outcomes'.format(repr_of(outcome)))
        failing = site.node.in_force.failing
        if label:
            listed = site.node.settings_of(label).failure_outcomes
            route = route_of(site.node.machine, label, outcome)
            failed = failure_kind(outcome, route, listed, failing) not in (
                FailureKind.NOT_A_FAILURE,
                FailureKind.UNREGISTERED_OUTCOME,
            )
        else:
            listed = self._node.settings.defaults.failure_outcomes
            failed = outcome in failing or outcome in listed
        if failed or is_preempted(outcome):
            raise NotMet('ended with {!r}'.format(outcome))
