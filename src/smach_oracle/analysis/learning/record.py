"""Reads what the trials of one machine teach: the rates of its states, and what its ways led to."""

from typing import Dict, Iterable, List, Mapping, NamedTuple, Optional, Sequence, Set, Tuple

from smach_oracle.oracle.decision.ways import WayResult
from smach_oracle.oracle.records.events import Event, EventKind
from smach_oracle.oracle.records.rates_format import Containers
from smach_oracle.oracle.settings.failure_rule import FailureRule

from ..bag_events import BagError
from ..counting.trial_summary import summarise
from ..replaying.checks import that_count
from ..replaying.followed import Key, key_of
from ..replaying.menus import recorded_menu
from ..replaying.replay import Replay
from ..replaying.way_reader import WayReader

NEEDED = ('estimator', 'memory', 'prior', 'policy', 'moderate_from', 'high_from')  # settings
WITHOUT_MENUS = (
    'no decision there has a menu, so nothing says which ways have helped. Menus are recorded '
    'under policies that go by ways: escalating, any_way, learned'
)


class MachineRecord(NamedTuple):
    """What the trials of one machine teach. States go by their paths below the top machine."""

    machine: str
    trials: int
    learned: Containers
    results: Mapping[str, Sequence[WayResult]]  # by state
    preconditions: Mapping[str, Sequence[str]]  # those that were run, by state
    rule: Optional[FailureRule]


def read_record(trials: Iterable[Sequence[Event]]) -> MachineRecord:
    """Return what trials teach. `trials`: the events of each.

    :raises BagError: where they are of several machines, tell no settings, or have no menu.
    """
    ordered = sorted((list(each) for each in trials), key=lambda events: events[0].wall_time)
    machines = list(dict.fromkeys(_machine_of(events) for events in ordered))
    if len(machines) > 1:
        raise BagError(
            'trials of several machines: {}. Name the folders of one'.format(', '.join(machines))
        )
    last = summarise(ordered[-1])
    settings = dict(last.settings)
    if not set(NEEDED) <= set(settings):
        raise BagError('its trials do not tell the settings of their oracle')
    rates, ways = Replay(settings, {}), WayReader()
    conditioned: Dict[Key, List[str]] = {}
    has_menus = False
    for events in ordered:
        for event in that_count(events):
            rates.take(event)
            ways.take(event)
            if event.kind == EventKind.PRECONDITION_START:
                names = conditioned.setdefault(key_of(event), [])
                names += [event.target] if event.target not in names else []
            elif event.kind == EventKind.DECISION:
                has_menus = has_menus or recorded_menu(event, {}) is not None
    if not has_menus:
        raise BagError(WITHOUT_MENUS)
    return MachineRecord(
        machines[0],
        len(ordered),
        _learned(rates, ways),
        {_below_top(key): list(log.results) for key, log in ways.logs.items() if log.results},
        {_below_top(key): names for key, names in conditioned.items()},
        last.rule,
    )


def _machine_of(events: Sequence[Event]) -> str:
    return events[0].path.partition('/')[0]


def _below_top(key: Key) -> str:
    return '/'.join(key).partition('/')[2]


def _learned(rates: Replay, ways: WayReader) -> Containers:
    """Return what was learned, as the containers of a rates file."""
    found: Containers = {}
    for key, snapshot in rates.learned().items():
        log = ways.logs.get(key)
        container = key[0].partition('/')[2]
        found.setdefault(container, {})[key[1]] = {
            **snapshot,
            **({} if log is None else log.told()),
        }
    return found


def states_named(record: MachineRecord, name: str) -> List[str]:
    """Return the states of a record by a label, or by a path, '' for the top machine left out."""
    known: Set[str] = {
        '/'.join(filter(None, (container, label)))
        for container, states in record.learned.items()
        for label in states
    }
    exact = name.strip('/')
    if exact in known:
        return [exact]
    return sorted(each for each in known if each.rpartition('/')[2] == exact)


Counted = Tuple[int, int]  # times that it helped, and results that are known


def counts_by_way(results: Iterable[WayResult]) -> Dict[str, Counted]:
    """Return how often each way has helped, of how often that is known, in order of appearance."""
    found: Dict[str, Counted] = {}
    for each in results:
        if each.helped is not None:
            helped, known = found.get(each.way, (0, 0))
            found[each.way] = helped + each.helped, known + 1
    return found
