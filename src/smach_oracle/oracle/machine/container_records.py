"""What is kept of one container: the settings in force, its records and history."""

import copy
from typing import Any, Counter, Dict, Mapping, Optional, Tuple

from ..decision.failure_rate import base_of
from ..decision.policies import policy_named
from ..decision.policy import Policy
from ..records.history import History
from ..records.streaks import Streaks
from ..records.visits import Visit, VisitMarks, VisitResult
from ..settings.failure_rule import FailureRule
from ..settings.names import Nested, Strictness
from ..settings.settings import ALLOW, RUN, Settings, StateSettings
from .state_record import FastEdge, StateRecord

# whether a way to it has helped a state whose visit ended so. Nobody knows of the others
_HELPED = {VisitResult.SUCCESS: True, VisitResult.FAILURE: False}


class ContainerSettings:
    """The settings of one container.

    They are those of the whole machine, those given with `add()`, and what follows from them.
    """

    def __init__(self, settings: Settings, name: str) -> None:
        self.name = name  # '' where nobody has given it one
        self.given_with_add: Dict[str, Dict[str, Any]] = {}  # by label
        self.strict: Strictness = True
        self.nested: Nested = True
        self.inherits = False  # wrapped for being nested: under the settings of the top machine
        self.use(settings)

    def use(self, settings: Settings) -> None:
        """Put settings of the whole machine into force. Those given with `add()` stay."""
        self.of_machine = settings
        # number of states for which they were last checked, None where they were not
        self.checked_states: Optional[int] = None
        self.policy: Policy = policy_named(settings.policy, settings.policy_parameters)
        self.rule = FailureRule(settings.failing_outcomes)
        self.failing = self.rule.failing
        self.deep_copy_keys = settings.deep_copy_keys
        self.userdata = settings.userdata or self.policy.userdata  # after a jump
        self._note_given()

    def give_with_add(self, label: str, given: Dict[str, Any]) -> None:
        """Put settings of a state into force that were given with `add()`."""
        self.given_with_add[label] = given
        self._note_given()

    def _note_given(self) -> None:
        # whether a state may not simply be entered, and whether one may be guarded
        self.limits_autonomy = self._sets('autonomy', RUN)
        self.guards_states = self._sets('on_retry', ALLOW)

    def inherit(self, above: 'ContainerSettings') -> None:
        """Be under the settings of the top machine, for being nested."""
        self.strict, self.nested, self.inherits = above.strict, above.nested, True

    def _sets(self, key: str, usual: str) -> bool:
        """Whether a setting of states is not as usual, for all or for one."""
        given = [*self.of_machine.states.values(), *self.given_with_add.values()]
        return getattr(self.of_machine.defaults, key) != usual or any(
            each.get(key, usual) != usual for each in given
        )

    def of_state(self, path: str, label: str) -> StateSettings:
        """Return the settings of a state of the container at `path`, relative to the top machine.

        What was given with `add()` counts unless the same key is set from outside.
        """
        own = self.given_with_add.get(label)
        settings = self.of_machine
        if own:
            outside: Mapping[str, object] = settings.states.get(label, {})
            settings = settings.with_states({label: {**own, **outside}})
        return settings.for_state(path, label)


class ContainerRecords:
    """The records of one container.

    `by_label` holds the records of the states that were needed so far.
    """

    def __init__(self, history: History) -> None:
        self.by_label: Dict[str, StateRecord] = {}
        self.history = history
        self.marks = VisitMarks()
        self.streaks = Streaks()
        # before a stop that was obeyed, each with the snapshot of its latest entry
        self._work: Optional[Tuple[Tuple[StateRecord, Optional[Dict[str, object]]], ...]] = None
        self._is_drawn = False  # the next state is what the author drew after `preempted`
        self.oracle_edges: Counter[str] = Counter()  # how often ORACLE led to a state or outcome
        # what a rates file says of states that are not there yet
        self.to_come: Dict[str, Dict[str, object]] = {}

    def make(self, label: str, settings: StateSettings, special: bool) -> StateRecord:
        """Make the record of a state, with what a rates file says of it.

        Another thread, which reads rates, may make it meanwhile. The first one is kept.
        """
        record = StateRecord(label, settings, special)
        learned = self.to_come.get(label)
        if learned is not None:
            record.restore(learned)
            record.shared = base_of(learned)
        record = self.by_label.setdefault(label, record)
        late = self.to_come.pop(label, None)
        if late is not None and late is not learned:  # a file was read meanwhile
            record.restore(late)
            record.shared = base_of(late)
        return record

    def learned(self) -> Dict[str, object]:
        """Return what was learned of each state that is there, as plain data."""
        return {label: record.learned() for label, record in dict(self.by_label).items()}

    def take_over(
        self, label: str, settings: StateSettings, learned: Mapping[str, object], is_shared: bool
    ) -> None:
        """Take over what was learned of a state, which may not be there yet.

        `is_shared`: whether the rates file has it.

        :raises ValueError: where it cannot be read.
        """
        StateRecord(label, settings).restore(learned)  # raises here, not in the middle of a trial
        if label not in self.by_label:
            self.to_come[label] = dict(learned)
            return
        self.by_label[label].restore(learned)
        if is_shared:
            self.by_label[label].shared = base_of(learned)

    def begin_trial(self) -> None:
        """Forget what belongs to a trial. The rates stay."""
        self.history.begin_trial()
        self.marks.clear()
        self.streaks.clear()
        for record in list(self.by_label.values()):
            record.begin_trial()

    def drop_snapshots(self) -> None:
        """Let go of the userdata that snapshots refer to, and of entries that never came."""
        self._work, self._is_drawn = None, False
        for record in list(self.by_label.values()):
            record.snapshot = None
            if record.special:
                record.forget_entry()

    # -- a stop that was obeyed

    def note_obeyed(self, label: str, cleans_within: bool) -> None:
        """Note that the state of that label has ended by a stop of the whole machine.

        What was executed before is work, what comes is not, until some of the work is. So is the
        state, but where it is a machine that is entered for the clean-up within it.
        """
        if not self.winds_down():
            self._work = tuple(
                (record, record.snapshot)
                for record in list(self.by_label.values())
                if (not cleans_within if record.label == label else record.snapshot is not None)
            )

    @property
    def has_obeyed(self) -> bool:
        """Whether a stop was obeyed in this execution."""
        return self._work is not None

    def winds_down(self) -> bool:
        """Whether a stop was obeyed, and no state of the work was entered since.

        Each entry takes a snapshot of its own.
        """
        return self._work is not None and all(
            record.snapshot is snapshot for record, snapshot in self._work
        )

    def note_drawn(self) -> None:
        """Note that the next state is what the author drew after `preempted`."""
        self._is_drawn = True

    def take_drawn(self) -> bool:
        """Return whether it is, once."""
        is_drawn, self._is_drawn = self._is_drawn, False
        return is_drawn

    def take_up_work(self) -> None:
        """Note that an operator has sent the machine on: what comes is work."""
        self._work = None
        self._is_drawn = False

    # -- visits

    def visit_ended(self, record: StateRecord, outcome: str, result: VisitResult) -> None:
        """Add a visit to the history, and a success to the rate.

        A failure is learned when it is judged.
        """
        if result is VisitResult.SUCCESS:
            record.learn(False)
        record.settle_way(_HELPED.get(result))
        record.visit_ended()
        self.history.visited(Visit(record.label, outcome, result), record.has_preconditions)

    def add_edge(
        self,
        record: StateRecord,
        outcome: str,
        target: str,
        drawn: Optional[str],
        message: str,
    ) -> None:
        """Let the next success of this kind take the short way through the records.

        `drawn`: see `FastEdge`. `message`: for the log, '' where it ends the container.
        """
        if outcome in record.fast:
            record.retire_edge(outcome)
        visit = Visit(record.label, outcome, VisitResult.SUCCESS)
        record.fast[outcome] = FastEdge(target, drawn, message, visit)

    def note_failure(self, record: StateRecord) -> None:
        """Note in the history that a state has failed, before its visit is added."""
        self.history.failed(record.label, record.totals[0])

    def __getstate__(self) -> Dict[str, object]:
        """Return copies, each made in one step: another thread may execute it meanwhile."""
        return {
            **vars(self),
            'by_label': self.by_label.copy(),
            'marks': VisitMarks(self.marks),
            'streaks': Streaks(self.streaks),
            'oracle_edges': self.oracle_edges.copy(),
            'to_come': self.to_come.copy(),
        }

    def twin(self) -> 'ContainerRecords':
        """Return records for a shallow copy of the machine, which learns on its own."""
        twin = ContainerRecords(copy.deepcopy(self.history))
        twin.by_label = copy.deepcopy(self.by_label.copy())
        twin.oracle_edges = self.oracle_edges.copy()
        twin.to_come = dict(self.to_come)
        return twin
