"""Makes what must hold before a state hold (paper, section IV-B). Runs of preconditions are no visits."""
import threading
from typing import Any, Optional

from .events import FailureKind
from .failure import failure_kind, route_of
from .naming import is_preempted
from .precondition_spec import PreconditionKind, PreconditionSpec
from .userdata import Gate, WriteWatch, behind, view_of


class NotMet(Exception):
    """Why a precondition is not met, in words; never leaves this module."""


class PreconditionRunner:
    """Runs the preconditions of one failure, one after the other, on the container's userdata behind a gate.

    `cancel` may be called from any thread, at any time: the state that runs is preempted, nothing more begins.
    """

    def __init__(self, machine: Any, ledger: Any, watch: WriteWatch) -> None:
        self._machine = machine
        self._ledger = ledger
        self._watch = watch
        self._gate = watch.gate
        self._lock = threading.Lock()
        self._running: Optional[Any] = None
        self._cancelled = False

    def cancel(self) -> None:
        """Preempt what runs, and let nothing more begin."""
        with self._lock:
            self._cancelled = True
            running = self._running
        if running is not None:
            running.request_preempt()

    def run(self, spec: PreconditionSpec) -> str:
        """Return '' where the precondition is met, else why not; what it wrote until then is taken back."""
        begun = self._watch.begin()
        try:
            self._achieve(spec)
        except NotMet as why:
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
            self._judge(spec.target, '', self._execute(spec.target, ''))
        else:
            self._run_label(spec.target)

    def _call(self, spec: PreconditionSpec) -> None:
        if self._cancelled:
            raise NotMet('preempted')
        try:
            result = spec.target(behind(self._gate))
        except Exception as err:
            raise NotMet('{} raised {!r}'.format(spec.name, err)) from err
        if result is None:
            raise NotMet('{} returned None; True is met'.format(spec.name))
        if not result:
            raise NotMet('{} returned {!r}'.format(spec.name, result))

    def _run_label(self, label: str) -> None:
        state = self._machine._states.get(label)
        if state is None or self._ledger.is_oracle(label):
            raise NotMet('there is no state {!r}'.format(label))
        self._judge(state, label, self._execute(state, label))

    def _execute(self, state: Any, label: str) -> Any:
        workers = self._ledger.tree.workers
        blocked = workers.blocked(state)
        if blocked:
            raise NotMet(blocked)
        with self._lock:
            if self._cancelled:
                raise NotMet('preempted')
            self._running = state
        try:
            return self._with_limit(state, label)
        except NotMet:
            raise
        except Exception as err:
            raise NotMet('raised {!r}'.format(err)) from err
        finally:
            self._ended(state)

    def _with_limit(self, state: Any, label: str) -> Any:
        def make_view(gate: Gate) -> Any:
            return view_of(self._machine, label, state, behind(gate))

        settings = self._ledger.settings_of(label) if label else None
        if settings is None or settings.time_limit_s is None:
            return state.execute(make_view(self._gate))
        result = self._ledger.tree.workers.run(state, make_view, self._gate.branch(), label, settings.time_limit_s,
                                               settings.grace_period_s)
        if result.error is not None:
            raise result.error
        if result.overrun:
            raise NotMet(result.overrun)
        return result.outcome

    def _ended(self, state: Any) -> None:
        with self._lock:
            self._running = None
            cancelled = self._cancelled
        if cancelled and not self._ledger.tree.workers.blocked(state):
            state.recall_preempt()  # the meta state services the request in its place

    def _judge(self, state: Any, label: str, outcome: Any) -> None:
        if self._cancelled:
            raise NotMet('preempted')
        if outcome not in state.get_registered_outcomes():
            raise NotMet('returned {!r}, which is no outcome of it'.format(outcome))
        failing = self._ledger.failing
        if label:
            listed = self._ledger.settings_of(label).failure_outcomes
            route = route_of(self._machine, label, outcome)
            failed = failure_kind(outcome, route, listed, failing) not in (
                FailureKind.NOT_A_FAILURE, FailureKind.UNREGISTERED_OUTCOME)
        else:
            failed = outcome in failing or outcome in self._ledger.settings.defaults.failure_outcomes
        if failed or is_preempted(outcome):
            raise NotMet('ended with {!r}'.format(outcome))
