"""Names for top-level machines that were given none: that of their node.

A name is the first part of every path, in events, bags and pages, so it has no '/' in it: of the
node /robot1/task it is `task`. What rospy adds to the name of an anonymous node is left out, for a
machine goes by one name in every run.
"""

import re
import threading
from contextlib import contextmanager
from typing import Any, Iterator, List, NamedTuple, Set, Tuple

import rospy

import smach
from smach_oracle.forking import in_child
from smach_oracle.oracle import OracleContainer, oracle_of
from smach_oracle.oracle.identity import WeakIdentityMap, remove_identical

# what every script is called that oracle_run.launch runs and nobody has named
LAUNCHED_NAME = 'oracle_run'
_ANONYMOUS = re.compile(r'_\d+_\d{13}$')  # process and ms, of init_node(anonymous=True)

Structure = Tuple[Any, ...]


class _Named(NamedTuple):
    """A name, and the machines that go by it."""

    structure: Structure
    name: str


class MachineNames:
    """The names of one process.

    The first machine has the name itself, the next ones NAME_2, NAME_3, ... in the order in which
    they first run. Machines of the same states and outcomes share a name, unless they run at the
    same time: a script that builds a new one for each trial is shown as one.

    `given`: this name, and not the node's. `script`: the name where the node has none that says
    anything.
    """

    def __init__(self) -> None:
        self.given = ''
        self.script = ''
        self._named: List[_Named] = []
        self._promised: Set[str] = set()
        self._given_to: WeakIdentityMap[smach.StateMachine, bool] = WeakIdentityMap()
        self._running: List[OracleContainer] = []
        self._lock = threading.Lock()
        in_child(self._let_go)

    def _let_go(self) -> None:
        self._lock = threading.Lock()

    def name_of(self, machine: smach.StateMachine) -> str:
        """Return the name for a machine that is not under an oracle yet, and runs next.

        It is '' where there is none: outside a node that has a name, and outside oracle_run.
        """
        with self._lock:
            name = self._find(tuple(machine.get_children()), machine)
            self._promised.add(name)
            self._given_to[machine] = True
            return name

    @contextmanager
    def running(self, machine: OracleContainer) -> Iterator[None]:
        """Give the machine a name for the body, which no other machine takes."""
        with self._lock:
            oracle = oracle_of(machine)
            is_given = machine in self._given_to
            if not oracle.is_named or (is_given and oracle.name in self._running_beside(machine)):
                meta = oracle.settings.oracle_label
                labels = tuple(label for label in machine.get_children() if label != meta)
                oracle.take_name(self._find(labels, machine))
                self._given_to[machine] = True
            self._promised.discard(oracle.name)
            self._running.append(machine)
        try:
            yield
        finally:
            with self._lock:
                remove_identical(self._running, machine)

    def _find(self, labels: Tuple[str, ...], machine: smach.StateMachine) -> str:
        stem = self._stem()
        if not stem:
            return ''  # it stays as it is, and may yet be named
        structure = labels, tuple(sorted(machine.get_registered_outcomes(), key=str))
        taken = self._promised.union(self._running_beside(machine))
        for named in self._named:
            if named.structure == structure and named.name not in taken:
                return named.name
        name = self._next(stem, taken.union(named.name for named in self._named))
        self._named.append(_Named(structure, name))
        return name

    def _running_beside(self, machine: smach.StateMachine) -> List[str]:
        return [oracle_of(each).name for each in self._running if each is not machine]

    @staticmethod
    def _next(stem: str, taken: Set[str]) -> str:
        count = 1
        name = stem
        while name in taken:
            count += 1
            name = '{}_{}'.format(stem, count)
        return name

    def _stem(self) -> str:
        node = node_name() if rospy.core.is_initialized() else ''
        if node == LAUNCHED_NAME and self.script:
            node = ''
        return self.given or node or self.script


def node_name() -> str:
    """Return the name of this node without its namespace, the same in every run."""
    return _ANONYMOUS.sub('', str(rospy.get_name()).rsplit('/', 1)[-1])


_names = MachineNames()


def machine_names() -> MachineNames:
    """Return the names of the machines of this process."""
    return _names
