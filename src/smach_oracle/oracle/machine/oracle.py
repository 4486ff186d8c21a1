"""The oracle of one container, for adapters that publish, record or print what it does."""

from typing import Callable, List, Optional

import smach

from ..asking.question import Expert
from ..errors import TrialError
from ..records.events import EventSource
from ..records.folder_locks import claim
from ..records.rates_file import read_rates, share_rates, write_rates
from ..records.visits import StateRateRow, TransitionRow
from ..scope.clock import Clock
from ..scope.scope import Waiting
from ..settings.health import HealthFunction
from ..settings.settings import Settings
from .health_watch import ListenToHealth
from .nesting import nodes_of
from .tree import AroundTrial
from .tree_node import TreeNode, node_of

# -- the rates file of a tree, where the settings name one


def save_rates(node: TreeNode) -> None:
    """Add what was learned to the rates file of the top machine, if there is one.

    What goes wrong is logged and stops nothing.
    """
    top = node.top()
    path = top.settings.rates_file
    if not path:
        return
    claim(path, top.in_force.name, top.tree)
    try:
        with node.tree.rates_lock:
            share_rates(path, top.in_force.name, nodes_of(top.machine), top.in_force.rule)
    except OSError as err:
        node.warn_once(path, 'rates file {} cannot be written: {}'.format(path, err))


def load_rates(node: TreeNode) -> None:
    """Read the rates file of the top machine, if it is another than the last one read."""
    path = node.settings.rates_file
    if node.parent is None and node.tree.rates_loaded != path:
        node.tree.rates_loaded = path
        if path:
            claim(path, node.in_force.name, node.tree)
        read_rates(path, node.in_force.name, nodes_of(node.machine), True, node.in_force.rule)


def write_by_hand(node: TreeNode, path: str) -> None:
    """Write what a machine has learned to a file.

    :raises OSError: where it cannot be written.
    """
    claim(path, node.top().in_force.name, node.tree)
    top = node.top()
    write_rates(path, top.in_force.name, nodes_of(node.machine), top.in_force.rule)


def read_by_hand(node: TreeNode, path: str) -> None:
    """Take over what a file has of a machine."""
    top = node.top()
    read_rates(path, top.in_force.name, nodes_of(node.machine), False, top.in_force.rule)


class Oracle:
    """The oracle of one container.

    A container has the same attributes itself, but a user's class may have taken their names for
    its own ends.

    >>> import smach
    >>> from smach_oracle.oracle import OracleContainer, oracle_of
    >>> results = iter(['aborted', 'succeeded'])
    >>> pick = smach.CBState(lambda userdata: next(results), outcomes=['succeeded', 'aborted'])
    >>> sm = smach.StateMachine(['succeeded', 'aborted'])
    >>> with sm:
    ...     _ = smach.StateMachine.add('PICK', pick)
    >>> oracle = oracle_of(OracleContainer.wrap(sm, name='task'))
    >>> oracle.events.observers.append(lambda event: print(event.seq, event.kind.name, event.text))
    >>> sm.execute()
    0 TRIAL_START
    1 CONTAINER_START
    2 STATE_START
    3 FAILURE
    4 TRANSITION
    5 DECISION PICK failed (its first result): trying it again
    6 JUMP
    7 STATE_START
    8 TRANSITION
    9 CONTAINER_END
    10 TRIAL_END
    'succeeded'
    >>> oracle.path, [round(row.rate, 2) for row in oracle.rates()]
    ('task', [0.18])
    """

    def __init__(self, node: TreeNode) -> None:
        self._node = node

    @property
    def name(self) -> str:
        """Return the name of the machine where it is the top one, else its label."""
        return (
            self._node.labels_from_parent[-1] if self._node.labels_from_parent else self._node.name
        )

    @property
    def is_named(self) -> bool:
        """Whether the machine was given a name, or has taken one."""
        return self._node.is_named

    def take_name(self, name: str) -> None:
        """Let the machine go by this name from its next trial on."""
        self._node.take_name(name)

    @property
    def path(self) -> str:
        """Return the container's path, such as TOP/PICK."""
        return self._node.path

    @property
    def settings(self) -> Settings:
        """Return the settings in force."""
        return self._node.settings

    @property
    def is_parents(self) -> bool:
        """Whether this is a child process of the program in which the machine has its oracle."""
        return self._node.tree.is_parents()

    @property
    def events(self) -> EventSource:
        """Return the events of the whole tree.

        Append a function to `events.observers` to be called with each.
        """
        return self._node.events

    @property
    def expert(self) -> Optional[Expert]:
        """Return the expert whom any container of the tree asks."""
        return self._node.tree.expert

    @expert.setter
    def expert(self, expert: Optional[Expert]) -> None:
        self._node.tree.expert = expert

    @property
    def waiting(self) -> Waiting:
        """Lets time pass where a policy waits: monotonic time, unless another clock is set."""
        return self._node.tree.waiting

    @waiting.setter
    def waiting(self, waiting: Waiting) -> None:
        self._node.tree.waiting = waiting

    @property
    def clock(self) -> Clock:
        """The clock of limits, deadlines and waits: monotonic time, unless a test sets another one.

        It is set between two trials.
        """
        return self._node.tree.clock.goes_by

    @clock.setter
    def clock(self, clock: Clock) -> None:
        self._node.tree.clock.goes_by = clock

    def count_work_by(self, clock: Clock) -> None:
        """Have the minutes by which ways are priced go by a clock, from the next trial on.

        Its time never goes back. Limits and deadlines stay in monotonic time.
        """
        self._node.tree.budget.count_work_by(clock)

    @property
    def health(self) -> Optional[HealthFunction]:
        """Says whether the robot is well, beside the setting `healthy`, from the next trial on."""
        return self._node.tree.health.given

    @health.setter
    def health(self, health: Optional[HealthFunction]) -> None:
        self._node.tree.health.given = health

    def listen_to_health(self, listen: ListenToHealth) -> None:
        """Have a port made for the topics and diagnostics of the setting `healthy`."""
        self._node.tree.health.listen = listen

    @property
    def describe_failure(self) -> Callable[[smach.State], str]:
        """The function that asks a state that failed by outcome what it knows of its failure."""
        return self._node.tree.describe_failure

    @describe_failure.setter
    def describe_failure(self, describe: Callable[[smach.State], str]) -> None:
        self._node.tree.describe_failure = describe

    @property
    def around_nested_trial(self) -> AroundTrial:
        """Return what is done around a trial of a nested machine that is executed by itself."""
        return self._node.tree.around_nested_trial

    @around_nested_trial.setter
    def around_nested_trial(self, around: AroundTrial) -> None:
        self._node.tree.around_nested_trial = around

    @property
    def trial_id(self) -> str:
        """Return the id of the present or latest trial, '' before the first."""
        return self._node.tree.trial_id

    @property
    def is_top(self) -> bool:
        """Whether no wrapped container is above this one."""
        return self._node.parent is None

    @property
    def recovers(self) -> bool:
        """Whether failures are recovered from, not only observed."""
        return self._node.tree.recover

    def note_shutdown(self) -> None:
        """Note that the process goes down, before the machine is preempted for that.

        A stored trial with an open question then stops where it stands, and can go on later.
        """
        self._node.tree.early_end.note_shutdown()

    def rates(self) -> List[StateRateRow]:
        """Return the learned rate of every state, of this container and all below it."""
        rows = []
        for node in nodes_of(self._node.machine):
            path = node.path
            for label in node.labels():
                record = node.record(label)
                successes, failures = record.totals
                rows.append(
                    StateRateRow(
                        path,
                        label,
                        record.rate,
                        int(record.failure_class),
                        successes,
                        failures,
                        record.recoveries,
                        record.has_preconditions,
                    )
                )
        return rows

    def transition_counts(self) -> List[TransitionRow]:
        """Return how often each transition was taken, in this container and all below it."""
        rows = []
        for node in nodes_of(self._node.machine):
            path = node.path
            for label, record in dict(node.records.by_label).items():
                rows += [
                    TransitionRow(path, label, outcome, target, count)
                    for (outcome, target), count in record.transitions().items()
                ]
            rows += [
                TransitionRow(path, node.settings.oracle_label, target, target, count)
                for target, count in dict(node.records.oracle_edges).items()
            ]
        return rows


def oracle_of(machine: object) -> Oracle:
    """Return the oracle of a wrapped machine.

    :raises TrialError: for a machine that is not under an oracle.
    """
    node = node_of(machine)
    if node is None:
        raise TrialError(
            '{!r} is not under an oracle; OracleContainer.wrap puts it there'.format(machine)
        )
    return Oracle(node)
