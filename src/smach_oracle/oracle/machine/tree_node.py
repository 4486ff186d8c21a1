"""The node of one container: its place in the tree, and what is kept beside its machine."""

import copy
from functools import partial
from typing import Any, Callable, Dict, Iterator, Mapping, Optional, Tuple

import smach

from ..records.events import EventKind
from ..records.history import History
from ..settings.names import is_nested_at
from ..settings.settings import Settings, StateSettings
from ..smach_private import EngineProbe, Labels, data_of, is_executing, mark_of, mark_on, states_of
from .container_records import ContainerRecords, ContainerSettings
from .execution import Execution
from .site import Site
from .state_record import StateRecord
from .tree import Tree
from .userdata import copied

DEFAULT_NAME = 'SM_ROOT'
NOT_COPIED = 'userdata key {!r} cannot be deep-copied, a reference is kept: {}'


def node_of(machine: object) -> Optional['TreeNode']:
    """Return the node of a wrapped machine, None for anything else."""
    node = mark_of(machine)
    return node if isinstance(node, TreeNode) else None


def marked_node(machine: smach.StateMachine) -> 'TreeNode':
    """Return the node of a machine that is known to be under an oracle."""
    node: TreeNode = mark_on(machine)
    return node


def entered_by_failures_alone(label: str) -> smach.InvalidStateError:
    """Return the error for who sends a machine to its meta state."""
    return smach.InvalidStateError('{!r} is entered by failures alone'.format(label))


class TreeNode:
    """Everything an OracleContainer keeps beside what its machine keeps.

    `parent`: node of the nearest wrapped container above, None for the top one.
    `labels_from_parent`: those that lead from there to here, those of a Concurrence or Iterator in
    between included. `in_force`: its settings. `records`: what it has learned and remembers.
    `engine`: how its engine steps. `execution`: the present one, or the latest. `site`: where its
    states run.
    """

    def __init__(
        self,
        machine: smach.StateMachine,
        tree: Tree,
        settings: Settings,
        name: str,
        site: Callable[['TreeNode'], Site] = Site,
    ) -> None:
        self.machine = machine
        self.parent: Optional['TreeNode'] = None
        self.labels_from_parent: Labels = ()
        self.in_force = ContainerSettings(settings, name)
        self.records = ContainerRecords(History(settings.history_length))
        self.engine = EngineProbe()
        self.site = site(self)
        self.join(tree)
        self.execution = Execution(self)

    def take_name(self, name: str) -> None:
        """Go by this name, unless it is empty."""
        self.in_force.name = name or self.in_force.name

    def join(self, tree: Tree) -> None:
        """Become part of a tree."""
        self.tree = tree
        self.events = tree.events
        self.trial_id = ''

    # -- its place

    @property
    def name(self) -> str:
        """Return the name of the machine."""
        return self.in_force.name or DEFAULT_NAME

    @property
    def is_named(self) -> bool:
        """Whether it was given."""
        return bool(self.in_force.name)

    def lie_below(self, parent: Optional['TreeNode'], labels: Labels) -> None:
        """Have this place in a tree. None: on its own, or at the top."""
        self.parent, self.labels_from_parent = parent, labels

    @property
    def path(self) -> str:
        """Return the path: the top machine's name and the labels below it, joined by '/'."""
        if self.parent is None:
            return self.in_force.name or DEFAULT_NAME
        labels, top = self._labels_from_top()
        return '/'.join((top.name,) + labels)

    def _labels_from_top(self) -> Tuple[Labels, 'TreeNode']:
        """Return the labels that lead here from the top machine, and its node."""
        labels: Labels = ()
        node = self
        while node.parent is not None:
            labels = node.labels_from_parent + labels
            node = node.parent
        return labels, node

    @property
    def key(self) -> str:
        """Its path, and of a branch the label, too: all branches of a Concurrence have one path."""
        label = self.site.label
        return '/'.join((self.path, label)) if label else self.path

    @property
    def relative_path(self) -> str:
        """Return the path below the top machine, '' for itself."""
        return '/'.join(self._labels_from_top()[0])

    def top(self) -> 'TreeNode':
        """Return the node of the top machine."""
        node = self
        while node.parent is not None:
            node = node.parent
        return node

    def around(self) -> Iterator['TreeNode']:
        """Yield the wrapped containers above this one, the innermost first."""
        above = self.parent
        while above is not None:
            yield above
            above = above.parent

    def has_running_ancestor(self) -> bool:
        """Whether a wrapped container above this one is being executed."""
        above = self.parent  # each execution asks: a plain loop takes the least time
        while above is not None:
            if is_executing(above.machine):
                return True
            above = above.parent
        return False

    def running_around(self) -> Iterator['TreeNode']:
        """Yield the wrapped containers above this one that are being executed."""
        return (above for above in self.around() if is_executing(above.machine))

    def start_from_above(self, take: bool = False) -> str:
        """Return the state in which a container around this one has it begin, '' for none.

        `take`: it does so once.
        """
        above = self.parent
        while above is not None:
            execution = above.execution
            if execution.starts_below:
                start = execution.start_of(self, take)
                if start:
                    return start
            above = above.parent
        return ''

    def why_left_behind(self) -> str:
        """Say why, where it is left behind."""
        return (
            'its trial ends early, and can go on later'
            if self.tree.early_end.why is not None
            else 'the state around it was abandoned'
        )

    @property
    def runs_in_branch(self) -> bool:
        """Whether a Concurrence or an Iterator lies between it and the wrapped container above."""
        return len(self.labels_from_parent) > 1 or not self.site.is_container

    def runs_beside_others(self) -> bool:
        """Whether a Concurrence or an Iterator is around it."""
        return any(each.runs_in_branch for each in (self, *self.around()) if each.parent)

    def wraps(self, below: Labels) -> bool:
        """Whether what these labels below this container lead to has an oracle of its own."""
        return is_nested_at(self.in_force.nested, '/'.join(self._labels_from_top()[0] + below))

    # -- settings and states

    @property
    def settings(self) -> Settings:
        """Return the settings of the whole machine in force here."""
        return self.in_force.of_machine

    def configure(self, settings: Settings) -> None:
        """Go on under these settings with what was learned."""
        self.in_force.use(self.site.settings_here(settings))
        self.records.history.resize(settings.history_length)
        for label, record in dict(self.records.by_label).items():
            record.configure(self.settings_of(label), self.is_special())

    def settings_of(self, label: str) -> StateSettings:
        """Return the settings of a state."""
        return self.site.settings_of_state(self.in_force.of_state(self.relative_path, label))

    def is_special(self) -> bool:
        """Whether more is to be done at each of its states than to execute it."""
        return bool(self.in_force.deep_copy_keys) or self.tree.numbers_visits

    def is_oracle(self, label: str) -> bool:
        """Whether `label` is the meta state's."""
        return self.tree.recover and label == self.in_force.of_machine.oracle_label

    def labels(self) -> Iterator[str]:
        """Yield the labels of the container's states, the meta state not among them."""
        return (label for label in list(states_of(self.machine)) if not self.is_oracle(label))

    def has(self, label: str) -> bool:
        """Whether the container has a state of that label, the meta state not among them."""
        return label in states_of(self.machine) and not self.is_oracle(label)

    def record(self, label: str) -> StateRecord:
        """Return the record of a state, made when it is first needed.

        :raises InvalidStateError: where there is no such state, or it is the meta state.
        """
        record = self.records.by_label.get(label)
        if record is None:
            if label not in states_of(self.machine):
                raise smach.InvalidStateError('{!r} is no state of {}'.format(label, self.path))
            if self.is_oracle(label):
                raise entered_by_failures_alone(label)
            record = self.records.make(label, self.settings_of(label), self.is_special())
        return record

    # -- what goes on

    def emit(
        self, kind: EventKind, state: str = '', outcome: str = '', target: str = '', **more: Any
    ) -> None:
        """Tell the observers, unless this container still runs from a trial that is over."""
        events = self.events
        if events.observers:
            events.emit(kind, self.path, self.trial_id, state, outcome, target, **more)

    def emit_rated(self, kind: EventKind, record: StateRecord, **fields: Any) -> None:
        """Tell the observers of what happens to a state, with its failure rate and class."""
        if self.events.observers:
            reading = record.read_rate()
            fields['failure_class'], fields['rate'] = int(reading.failure_class), reading.rate
            self.emit(kind, record.label, **fields)

    def warn(self, text: str, label: str = '') -> None:
        """Log what the operator should know, and tell the observers."""
        smach.logwarn('{}{}: {}'.format(self.path, '/' + label if label else '', text))
        self.emit(EventKind.WARNING, state=label, text=text)

    def warn_once(self, about: str, text: str, label: str = '') -> None:
        """Warn once in a trial of what may come at each visit. `about`: what it is about."""
        if self.tree.is_new(self.path, label, about):
            self.warn(text, label)

    def _warn_not_copied(self, key: str, why: str) -> None:
        self.warn_once('copy of ' + key, NOT_COPIED.format(key, why))

    def begin_trial(self, trial_id: str) -> None:
        """Forget what belongs to a trial. The rates stay."""
        self.trial_id = trial_id
        self.tree.resumed.forget(self.records)
        self.records.begin_trial()

    def begin_execution(self, execution: Execution) -> None:
        """Have this as the present execution, and forget what belongs to the one before."""
        self.execution = execution
        if self.trial_id != self.tree.trial_id:
            self.begin_trial(self.tree.trial_id)
        self.records.history.begin_execution()
        self.engine.begin_execution()
        entry = self.tree.resumed.entry_of(self.records)
        if entry is not None:
            entry.take_over_records()

    def begin_once_more(self) -> None:
        """Begin an execution as the one that is there already."""
        self.execution.renew()
        self.records.drop_snapshots()
        self.begin_execution(self.execution)

    def begin_stepping(self) -> None:
        """Find out at the first state of an execution what the engine is like."""
        self.engine.look(self.machine, self.in_force.limits_autonomy, self.tree.classes)
        self.tree.control.attend(self.engine)

    def snapshot(self, data: Optional[Mapping[str, object]] = None) -> Dict[str, object]:
        """Return userdata as it is now, or that in `data`.

        It holds references. `deep_copy_keys` are copied through and through.
        """
        snapshot = dict(data_of(self.machine.userdata) if data is None else data)
        for key in self.in_force.deep_copy_keys:
            if key in snapshot:
                snapshot[key] = copied(snapshot[key], partial(self._warn_not_copied, key))
        return snapshot

    # -- learned rates, for a rates file (rates_file.Learner)

    def learn(self, label: str, learned: Mapping[str, object], is_shared: bool) -> None:
        """Take over what was learned of a state. `is_shared`: whether the rates file has it.

        :raises ValueError: where it cannot be read.
        """
        self.records.take_over(label, self.settings_of(label), learned, is_shared)

    def twin_for(self, machine: smach.StateMachine) -> 'TreeNode':
        """Return a node for a shallow copy of the machine.

        It has the same tree and settings, and rates of its own.
        """
        twin = copy.copy(self)
        twin.machine = machine
        twin.execution = Execution(twin)
        twin.records = self.records.twin()
        twin.in_force = copy.copy(self.in_force)
        twin.in_force.given_with_add = dict(self.in_force.given_with_add)
        twin.engine = EngineProbe()
        twin.site = Site(twin)
        return twin
