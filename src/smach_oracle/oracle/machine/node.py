"""The bookkeeping of one container: its records, its history, its place in the tree."""
import copy
from typing import Any, Dict, Iterator, Optional, Tuple

import smach

from .config import Settings
from .errors import ConfigError
from .events import EventKind
from .failure import Failure, Route
from .failure_rate import FailureClass
from .history import History
from .naming import FailingNames
from .policy import Chain, Policy, policy_named
from .question import Visit, VisitResult
from .rates_file import read_rates, write_rates
from .reporting import Face, ledgers_of
from .state_record import Edge, StateRecord
from .tree import Tree
from .userdata import take_snapshot

DEFAULT_NAME = 'SM_ROOT'


class Ledger:
    """Everything an OracleContainer keeps beside what its machine keeps.

    `parent`: ledger of the nearest wrapped container above, None for the top one. `below`: labels that lead here from
    the parent, those of a Concurrence or Iterator in between included.
    """

    def __init__(self, machine: Any, tree: Tree, settings: Settings, name: str) -> None:
        self.machine = machine
        self.face = Face(self)
        self.parent: Optional['Ledger'] = None
        self.below: Tuple[str, ...] = ()
        self.name = name or DEFAULT_NAME
        self.records: Dict[str, StateRecord] = {}
        self.own_states: Dict[str, Dict[str, Any]] = {}  # settings given with add(), by label
        self.checked_states = -1  # number of states for which the settings were last checked
        self.strict = True
        self.preempt_told = False
        self.stepped = False  # whether this execution has come to its first state
        self.lock_is_held = False
        self.attentive = True  # whether a step begins with a closer look
        self.tells_transitions = True
        self.abandoned: Dict[int, Any] = {}  # the tree's, for a quick look
        self.nested = True
        self.inherits = False  # wrapped for being nested: under the settings of the top machine
        self.oracle_edges: Dict[str, int] = {}
        self.history = History(settings.history_length)
        self.learned: Dict[str, Any] = {}  # estimators of states that are not there yet, from a rates file
        self.join(tree)
        self.configure(settings)

    def join(self, tree: Tree) -> None:
        """Become part of a tree."""
        self.tree = tree
        self.events = tree.events
        self.trial_id = ''

    def configure(self, settings: Settings) -> None:
        """Go on under these settings with what was learned."""
        self.settings = settings
        self.policy: Policy = policy_named(settings.policy)
        self.failing = FailingNames(settings.failing_outcomes)
        self.deep_copy_keys = settings.deep_copy_keys
        self.history.resize(settings.history_length)
        self.checked_states = -1
        for label, record in self.records.items():
            record.configure(self.settings_of(label), bool(settings.deep_copy_keys))

    @property
    def path(self) -> str:
        """Container path: the top machine's name and the labels below it, joined by '/'."""
        if self.parent is None:
            return self.name
        return '/'.join((self.parent.path,) + self.below)

    @property
    def relative_path(self) -> str:
        """Path below the top machine, '' for itself."""
        if self.parent is None:
            return ''
        above = self.parent.relative_path
        return '/'.join(((above,) if above else ()) + self.below)

    def settings_of(self, label: str) -> Any:
        """Return the settings of a state; those given with add() count unless a key of it is set from outside."""
        own = self.own_states.get(label)
        settings = self.settings
        if own:
            given = {**own, **dict(settings.states.get(label, {}))}
            settings = settings.with_states({label: given})
        return settings.for_state(self.relative_path, label)

    def record(self, label: str) -> StateRecord:
        """Return the record of a state, made when it is first needed. Raises InvalidStateError."""
        record = self.records.get(label)
        if record is None:
            if label not in self.machine._states:
                raise smach.InvalidStateError('{!r} is no state of {}'.format(label, self.path))
            if self.is_oracle(label):
                raise smach.InvalidStateError('{!r} is entered by failures alone'.format(label))
            record = self.records[label] = StateRecord(label, self.settings_of(label), bool(self.deep_copy_keys))
            self._recall(record)
        return record

    def _recall(self, record: StateRecord) -> None:
        learned = self.learned.pop(record.label, None)
        if learned is not None:
            record.restore(learned)

    def learned_rates(self) -> Dict[str, Any]:
        """Return what was learned of each state, as plain data."""
        learned = dict(self.learned)
        learned.update((label, record.learned()) for label, record in list(self.records.items()))
        return learned

    def learn(self, label: str, learned: Any) -> None:
        """Take over what was learned of a state, which may not be there yet. Raises ValueError."""
        settings = self.settings_of(label)
        StateRecord(label, settings).restore(learned)  # raises here, not in the middle of a trial
        if label in self.records:
            self.records[label].restore(learned)
        else:
            self.learned[label] = dict(learned)

    def top(self) -> 'Ledger':
        """Return the ledger of the top machine."""
        return self if self.parent is None else self.parent.top()

    def save_rates(self) -> None:
        """Write the rates file of the top machine, if there is one; what goes wrong is said and stops nothing."""
        top = self.top()
        path = top.settings.rates_file
        if not path:
            return
        try:
            with self.tree.rates_lock:
                write_rates(path, ledgers_of(top.machine))
        except OSError as err:
            self.warn('rates file {} cannot be written: {}'.format(path, err))

    def bring_up_to_date(self) -> None:
        """Take notice of states added since. Raises ConfigError."""
        self.machine._sync_oracle()
        if len(self.machine._states) != self.checked_states:
            self.check_settings()
            self.checked_states = len(self.machine._states)
        if self.parent is None and self.tree.rates_loaded != self.settings.rates_file:
            self.tree.rates_loaded = self.settings.rates_file
            read_rates(self.settings.rates_file, ledgers_of(self.machine))

    def begin_stepping(self) -> None:
        """At the first state of an execution, look at what the engine and the machine's class are like.

        Some engines hold the machine's lock around a step, with a plain lock all do; others leave it to the step.
        """
        self.stepped = True
        cls = type(self.machine)
        is_owned = getattr(self.machine._state_transitioning_lock, '_is_owned', None)  # of a re-entrant lock
        self.lock_is_held = is_owned is None or is_owned()
        self.attentive = cls.preempt_requested is not smach.State.preempt_requested
        self.tells_transitions = cls.call_transition_cbs is not smach.Container.call_transition_cbs
        self.abandoned = self.tree.workers.abandoned

    def twin_for(self, machine: Any) -> 'Ledger':
        """Return a ledger for a shallow copy of the machine: the same tree and settings, rates of its own."""
        twin = copy.copy(self)
        twin.machine = machine
        twin.face = Face(twin)
        twin.records = copy.deepcopy(self.records)
        twin.history = copy.deepcopy(self.history)
        twin.oracle_edges = dict(self.oracle_edges)
        twin.own_states = dict(self.own_states)
        twin.learned = dict(self.learned)
        return twin

    def is_oracle(self, label: str) -> bool:
        """Whether `label` is the meta state's."""
        return self.tree.recover and label == self.settings.oracle_label

    def labels(self) -> Iterator[str]:
        """Yield the labels of the container's states, the meta state not among them."""
        return (label for label in list(self.machine._states) if not self.is_oracle(label))

    def emit(self, kind: EventKind, **fields: Any) -> None:
        """Tell the observers, unless this container still runs from a trial that is over."""
        if self.events.observers and self.trial_id == self.tree.trial_id:
            self.events.emit(kind, self.path, **fields)

    def warn(self, text: str, label: str = '') -> None:
        """Say what the operator should know, in the log and to the observers."""
        smach.logwarn('{}{}: {}'.format(self.path, '/' + label if label else '', text))
        self.emit(EventKind.WARNING, state=label, text=text)

    def begin_trial(self, trial_id: str) -> None:
        """Forget what belongs to a trial; the rates stay."""
        self.trial_id = trial_id
        self.history.begin_trial()
        for record in self.records.values():
            record.begin_trial()

    def begin_execution(self) -> None:
        """Forget what belongs to one execution of the container."""
        if self.trial_id != self.tree.trial_id:
            self.begin_trial(self.tree.trial_id)
        self.history.begin_execution()
        self.preempt_told = False
        self.stepped = False
        self.attentive = True
        self.drop_snapshots()

    def drop_snapshots(self) -> None:
        """Let go of the userdata that snapshots refer to."""
        for record in self.records.values():
            record.snapshot = None

    def snapshot(self) -> Dict[str, Any]:
        """Return the userdata as it is now."""
        return take_snapshot(self.machine.userdata._data, self.deep_copy_keys, smach.logwarn)

    def has_running_ancestor(self) -> bool:
        """Whether a wrapped container above this one is being executed."""
        above = self.parent
        while above is not None:
            if above.machine._is_running:
                return True
            above = above.parent
        return False

    def chain(self, record: StateRecord) -> Chain:
        """Return what the chain of visits says about a failure of a state, and note the failure in it."""
        history, label = self.history, record.label
        successes, _ = record.totals
        failed_last, failing_since = history.failed_last(label), history.failing_since(label, successes)
        unconditioned = history.unconditioned
        history.failed(label, successes)
        return Chain(label, self.machine._initial_state_label, failed_last, failing_since, unconditioned,
                     history.succeeded_before(label))

    def tell_failure(self, failure: Failure, rate: float, failure_class: FailureClass, continuous: bool) -> None:
        """FAILURE: rate and class are those before this failure is counted."""
        self.emit(EventKind.FAILURE, state=failure.state, outcome=failure.outcome, failure_kind=int(failure.kind),
                  failure_class=int(failure_class), rate=rate, continuous=continuous, text=failure.text)

    def visit_ended(self, record: StateRecord, outcome: str, result: VisitResult) -> None:
        """Add a visit to the history, and a success to the rate; a failure is learned when it is judged."""
        if result is VisitResult.SUCCESS:
            record.learn(False)
        record.visit_ended()
        self.history.visited(Visit(record.label, outcome, result), record.has_preconditions)

    def add_edge(self, record: StateRecord, outcome: str, route: Route, message: str) -> None:
        """Let the next success of this kind take the short way through the books."""
        if outcome in record.fast:
            record.retire_edge(outcome)
        record.fast[outcome] = Edge(route.target, message, Visit(record.label, outcome, VisitResult.SUCCESS))

    def count_oracle_edge(self, target: str) -> None:
        """Count a way out of the meta state."""
        self.oracle_edges[target] = self.oracle_edges.get(target, 0) + 1

    def tell_preempt(self) -> None:
        """PREEMPT, once for each request."""
        if not self.preempt_told:
            self.preempt_told = True
            self.emit(EventKind.PREEMPT, state=self.machine._current_label or '')

    def check_settings(self) -> None:
        """Check what depends on the states being there. Raises ConfigError, or warns where not strict."""
        for label in self.labels():
            for spec in self.settings_of(label).preconditions:
                for named in spec.labels():
                    self._check_precondition(label, named)

    def _check_precondition(self, label: str, named: str) -> None:
        if named in self.machine._states and named != label and not self.is_oracle(named):
            return
        err = ConfigError('states.{}.preconditions'.format(label), named,
                          'the labels of the other states of {}: {}'.format(
                              self.path, ', '.join(sorted(other for other in self.labels() if other != label))))
        if self.strict:
            raise err
        smach.logwarn(str(err))
