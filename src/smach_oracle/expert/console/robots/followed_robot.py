"""One robot as its topics show it: containers, active states, learned rates."""

import threading
from typing import Dict, FrozenSet, List, Optional, Tuple

from smach_msgs.msg import SmachContainerStatus, SmachContainerStructure
from smach_oracle.analysis.graphs.container_graph import (
    ContainerGraph,
    GraphEdge,
    drawing,
    make_structure,
    shares,
    structure_from_counts,
)
from smach_oracle.analysis.graphs.drawn_graph import TransitionCount
from smach_oracle.msg import ControlStatus, OracleEvent, OracleRates
from smach_oracle.oracle.records.short_text import shortened

from ...wording import event_words
from ..feeds.control_view import control_view
from ..feeds.views import event_of, number, rates_view
from ..graphs.layout_worker import LayoutWorker
from ..shapes.basics import ByPath, ByState
from ..shapes.robots import (
    FailedStateView,
    HeldMachineView,
    LastWordView,
    LatestTransition,
    LearnedRateView,
    LiveMachinesView,
)
from ..web.sections import PageSections
from .same_machine import Source

MOST_CONTAINERS = 200
LONGEST_WORDS = 200
_LEAVES_ORACLE = (
    OracleEvent.JUMP,
    OracleEvent.SUPERSEDE,
    OracleEvent.GIVE_UP,
    OracleEvent.TRIAL_END,
)
_ENDS_WAIT = (OracleEvent.HEALTH_WAIT_END, OracleEvent.TRIAL_START, OracleEvent.TRIAL_END)


class FollowedRobot:
    """A robot whose topics are followed. ROS threads feed it. One thread calls `write_sections`."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.changed = True
        self.alive = True
        self.learns = False
        self._reshaped = True
        self._lock = threading.Lock()
        self._structures: Dict[str, ContainerGraph] = {}
        self._active: Dict[str, List[str]] = {}
        self._latest: ByPath[LatestTransition] = {}
        self._failed: ByPath[FailedStateView] = {}
        self._rates: ByPath[ByState[LearnedRateView]] = {}
        self._counts: ByPath[List[TransitionCount]] = {}
        self._trial = ''
        self._unwell = ''  # why it waits until it is well
        self._last: Optional[LastWordView] = None  # what it said last, and when
        # how its machines stand. None means they cannot be held
        self.machines: Optional[List[HeldMachineView]] = None

    def on_structure(self, message: SmachContainerStructure) -> None:
        """A container's graph. Most repeat what is known."""
        path = message.path.lstrip('/')
        edges = [
            GraphEdge(*each)
            for each in zip(message.outcomes_from, message.internal_outcomes, message.outcomes_to)
        ]
        structure = make_structure(path, message.children, edges, message.container_outcomes)
        with self._lock:
            room = path in self._structures or len(self._structures) < MOST_CONTAINERS
            if room and self._structures.get(path) != structure:
                self._structures[path] = structure
                self.changed = self._reshaped = True

    def on_status(self, message: SmachContainerStatus) -> None:
        """Note which states are active in a container."""
        path = message.path.lstrip('/')
        with self._lock:
            if self._active.get(path) != message.active_states:
                self._active[path] = list(message.active_states)
                self.changed = True

    def on_rates(self, message: OracleRates) -> None:
        """Note what was learned. A message covers one top machine."""
        rates = rates_view(message)
        rows: ByPath[List[Tuple[str, str, str, int]]] = {}
        for row in message.transitions:
            rows.setdefault(row.path, []).append((row.state, row.outcome, row.target, row.count))
        with self._lock:
            self.learns = True
            self._rates.update(rates)
            self._counts.update({path: shares(counts) for path, counts in rows.items()})
            self.changed = True
            self._reshaped = self._reshaped or any(path not in self._structures for path in rates)

    def on_control(self, message: ControlStatus) -> None:
        """Note how its machines stand as operators see them."""
        machines = control_view(message)
        with self._lock:
            if machines != self.machines:
                self.machines = machines
                self.changed = True

    def containers(self) -> FrozenSet[str]:
        """Return the paths of all that is known of it."""
        with self._lock:
            known = [machine['path'] for machine in self.machines or []]
            active = [each['path'] for machine in self.machines or [] for each in machine['active']]
            return frozenset([*known, *active, *self._all_structures()])

    def on_event(self, message: OracleEvent) -> None:
        """The path that is taken, and where it failed."""
        event = event_of(message)
        words, time_s = event_words(event), event.wall_time
        with self._lock:
            self.learns = True
            self._trial = message.trial_id
            if words:
                self._last = {'words': shortened(words, LONGEST_WORDS), 'at': time_s}
            self._take_health(message)
            if message.kind == OracleEvent.TRIAL_START:
                self._failed.clear()
                self._latest.clear()
            elif message.kind == OracleEvent.TRANSITION:
                self._latest[message.path] = (message.state, message.target)
            elif message.kind == OracleEvent.FAILURE:
                self._failed[message.path] = {'state': message.state, 'rate': number(message.rate)}
            elif message.kind == OracleEvent.JUMP:
                self._latest[message.path] = ('', message.target)
            if message.kind in _LEAVES_ORACLE or message.kind == OracleEvent.CONTAINER_END:
                self._failed.pop(message.path, None)
            self.changed = True

    def _take_health(self, message: OracleEvent) -> None:
        if message.kind == OracleEvent.HEALTH_WAIT_START:
            self._unwell = message.text or 'it does not say why'
        elif message.kind in _ENDS_WAIT:
            self._unwell = ''

    def write_sections(self, sections: PageSections, layouts: LayoutWorker) -> None:
        """Write this robot's sections where something has changed."""
        with self._lock:
            if not self.changed:
                return
            self.changed = False
            reshaped, self._reshaped = self._reshaped, False
            structures = self._all_structures()
            live: LiveMachinesView = {
                'trial': self._trial,
                'alive': self.alive,
                'unwell': self._unwell,
                'last': self._last,
                'active': dict(self._active),
                'latest': dict(self._latest),
                'failed': dict(self._failed),
                'rates': dict(self._rates),
                'counts': dict(self._counts),
                'paths': sorted(structures),
                'control': self.machines,
            }
        sections.put('live ' + self.name, live)
        if reshaped:
            self._write_graphs(structures, sections, layouts)

    def _write_graphs(
        self, structures: Dict[str, ContainerGraph], sections: PageSections, layouts: LayoutWorker
    ) -> None:
        for path, structure in structures.items():
            nested = [
                label for label in structure.states if '{}/{}'.format(path, label) in structures
            ]
            layout = layouts.find(structure, self._note_layout)
            sections.put('graph {} {}'.format(self.name, path), drawing(structure, layout, nested))

    def forget(self, sections: PageSections) -> None:
        """Take this robot's sections away."""
        for path in self._all_structures():
            sections.put('graph {} {}'.format(self.name, path), None)
        sections.put('live ' + self.name, None)

    def source(self, nodes: FrozenSet[str]) -> Source:
        """Return what it shows, to compare. `nodes`: those that publish it."""
        with self._lock:
            return Source(
                self.name,
                nodes,
                self.learns,
                {
                    path: frozenset(structure.states)
                    for path, structure in self._all_structures().items()
                },
            )

    def set_alive(self, alive: bool) -> None:
        """Whether the master knows it now."""
        if alive != self.alive:
            self.alive = alive
            self.changed = True

    def _note_layout(self) -> None:
        self.changed = self._reshaped = True

    def _all_structures(self) -> Dict[str, ContainerGraph]:
        """The structures of introspection. Of other paths what rates and transitions show."""
        found = dict(self._structures)
        for path, rates in self._rates.items():
            if path not in found:
                found[path] = structure_from_counts(path, list(rates), self._counts.get(path, []))
        return found
