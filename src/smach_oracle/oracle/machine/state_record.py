"""The oracle's memory of one state of a container. Pure, and without smach."""

import copy
import threading
from operator import attrgetter
from typing import (
    TYPE_CHECKING,
    Any,
    Callable,
    Counter,
    Dict,
    List,
    Mapping,
    NamedTuple,
    Optional,
    Tuple,
)

from ..decision.failure_rate import (
    Estimator,
    FailureClass,
    base_of,
    classify,
    make_estimator,
    merged,
)
from ..decision.ways import Count
from ..records.events import FailureKind
from ..records.visits import Visit
from ..records.way_results import WayLog, WayResult, merged_ways
from ..settings.settings import StateSettings

if TYPE_CHECKING:
    from .places import TreePlace
    from .userdata import StateView


class RateReading(NamedTuple):
    """What the results of a state say of it, read at one moment."""

    rate: float  # 0 to 1, the learned failure rate
    recent: Tuple[int, int]  # failures among the latest results, and their number. 0, 0: not known
    failure_class: FailureClass
    successes: int  # in all
    tried: str  # what the oracle did after its latest failure, '' where it has succeeded since


_NOTHING_TRIED = '', 0
_COUNT_OF = attrgetter('count')
_ENDS = object()  # no transition is drawn to it, so no machine goes on by it


class FastEdge:
    """A transition without any failure, with all that its next use needs.

    `target`: the state that is next, nothing where the container ends. `leads_to`: that state, or
    the container outcome. `drawn`: its entry among the author's transitions.
    """

    __slots__ = ('target', 'leads_to', 'drawn', 'count', 'message', 'visit')

    def __init__(self, leads_to: str, drawn: Optional[str], message: str, visit: Visit) -> None:
        """`message`: for the log, '' where it ends the container."""
        self.target: Any = leads_to if message else _ENDS
        self.leads_to = leads_to
        self.drawn = drawn
        self.count = 0
        self.message = message
        self.visit = visit


class StateRecord:
    """Learned rate, counts and latest snapshot of one state.

    Successes by way of a `FastEdge` are counted there and reach the estimator when somebody asks
    for it: their order among each other does not matter, and a failure is always learned after
    them.
    """

    def __init__(self, label: str, settings: StateSettings, special: bool = False) -> None:
        self.label = str.__str__(label)  # that of a member of an Enum is its value
        self.fast: Dict[Any, FastEdge] = {}
        self.snapshot: Optional[Dict[str, object]] = None
        self.view: Optional['StateView'] = None  # from its last visit
        self.recoveries = 0  # of this trial
        # of this trial: times that nobody answered and `on_no_answer` led to a state
        self.fallbacks = 0
        # of this trial: repeats after failures while the robot was not well, which nobody counts
        self.unwell_repeats = 0
        # s, of the visits that ended by themselves and were timed, a plain success that nobody
        # observes is not
        self.longest_s: Optional[float] = None
        self._tried = _NOTHING_TRIED
        self.entered_by_oracle = False  # at the coming visit
        # at the coming visit: the state in which each container below it begins
        self.way_down: Tuple['TreePlace', ...] = ()
        self._learned = 0  # successes by way of edges that the estimator knows
        # what of it the rates file has, as `base_of` tells it
        self.shared: Dict[str, object] = {}
        self._ways = WayLog()
        # its latest failure in this program: kind, outcome and text
        self.last_failure: Optional[Tuple[FailureKind, str, str]] = None
        self._retired = 0  # successes by way of edges that are no more
        self._edges: Counter[Tuple[str, str]] = Counter()  # transitions not counted by an FastEdge
        self._visits = 0  # not counted by an FastEdge
        self._visits_before = 0  # visits of earlier trials
        self._estimator = make_estimator(settings.estimator, settings.memory, settings.prior)
        self._lock = threading.RLock()  # rates are read from other threads
        self.configure(settings, special)

    def configure(self, settings: StateSettings, special: bool) -> None:
        """Go on under other settings with what was learned.

        `special`: more is to be done than to execute the state.
        """
        self.settings = settings
        self.has_preconditions = bool(settings.preconditions)
        self.be_special(special)
        with self._lock:
            learned = self._up_to_date().snapshot()
            self._estimator = make_estimator(settings.estimator, settings.memory, settings.prior)
            self._estimator.restore(learned)
        self.retire_edges()

    def be_special(self, special: bool) -> None:
        """Have more done than to execute the state, which a time limit wants in any case."""
        self._is_special = special or self.settings.time_limit_s is not None
        self.special = self._is_special or self.entered_by_oracle or bool(self.way_down)

    def enter_by_oracle(self) -> None:
        """Note that the oracle leads to the state, which is visited next."""
        self.entered_by_oracle = self.special = True

    def go_down(self, way_down: Tuple['TreePlace', ...]) -> None:
        """Note in which state each container below begins at the visit that is next."""
        self.way_down = way_down
        self.special = self.special or bool(way_down)

    def go_on(self, counts: List[int], longest_s: Optional[float]) -> None:
        """Go on counting: visits, recoveries, fallbacks, and repeats while not well, of the trial.

        :raises ValueError: where these are not four numbers.
        """
        visits, self.recoveries, self.fallbacks, self.unwell_repeats = counts
        self._visits_before = self._visits + self._by_edges() - visits
        self.longest_s = longest_s

    def forget_entry(self) -> None:
        """Note that the visit to which the oracle led begins now, or never."""
        self.entered_by_oracle = False
        self.way_down = ()
        self.special = self._is_special

    def _up_to_date(self) -> Estimator:
        """The estimator, told of the successes by way of edges.

        It is to be called with the lock held.
        """
        estimator, by_edges = self._estimator, self._by_edges()
        if by_edges != self._learned:
            estimator.add_successes(by_edges - self._learned)
            self._learned = by_edges
        return estimator

    def learn(self, failed: bool) -> None:
        """Learn the result of a visit that took no FastEdge."""
        with self._lock:
            self._up_to_date().add(failed)

    def take_back_failure(self) -> None:
        """Unlearn the latest result, a failure."""
        with self._lock:
            self._up_to_date().take_back_failure()

    def learned(self) -> Dict[str, object]:
        """Return what was learned as plain data."""
        with self._lock:
            return {**self.rates(), **self.way_results()}

    def rates(self) -> Dict[str, object]:
        """Return what was learned of its failure rate as plain data."""
        with self._lock:
            return self._up_to_date().snapshot()

    def way_results(self) -> Dict[str, object]:
        """Return the results of its ways as plain data, the same object until there is one more.

        It is empty where there is none. See `WayLog.told`.
        """
        with self._lock:
            return self._ways.told()

    def merged_with(
        self, theirs: Mapping[str, object], base: Optional[Mapping[str, object]] = None
    ) -> Dict[str, object]:
        """Return what others have learned, with what was learned here since `base`.

        :param base: None: what was last shared.

        :raises ValueError: where theirs cannot be read.
        """
        with self._lock:
            own, base = self.learned(), self.shared if base is None else base
            rates = merged(own, base, theirs, self.settings.memory)
            return {**rates, **merged_ways(own, base, theirs)}

    def share(self, before: Mapping[str, object], written: Mapping[str, object]) -> None:
        """Have what is shared now. `before`: what was learned here when it was merged."""
        with self._lock:
            if before != written:
                self.restore(self.merged_with(written, base_of(before)))
            self.shared = base_of(written)

    @property
    def rate(self) -> float:
        """Return the learned failure rate, 0 to 1."""
        with self._lock:
            return self._up_to_date().rate

    @property
    def failure_class(self) -> FailureClass:
        """Return the class by the learned rate."""
        return self._class_of(self.rate)

    def _class_of(self, rate: float) -> FailureClass:
        return classify(rate, self.settings.moderate_from, self.settings.high_from)

    def read_rate(self, and_failure: bool = False) -> RateReading:
        """Return what the results so far say. `and_failure`: and one failure more."""
        with self._lock:
            estimator = self._up_to_date()
            if and_failure:
                estimator = copy.deepcopy(estimator)
                estimator.add(True)
            rate, recent = estimator.rate, estimator.recent
            successes = estimator.successes
            what, then = self._tried
        tried = what if then == successes else ''
        return RateReading(rate, recent, self._class_of(rate), successes, tried)

    @property
    def totals(self) -> Tuple[int, int]:
        """Return the numbers of successes and failures in all."""
        with self._lock:
            estimator = self._up_to_date()
            return estimator.successes, estimator.failures

    @property
    def visits(self) -> int:
        """Return the visits of this trial that have ended."""
        return self._visits + self._by_edges() - self._visits_before

    def begin_trial(self) -> None:
        """Count the visits and recoveries of a new trial."""
        self.recoveries = self.fallbacks = self.unwell_repeats = 0
        self._tried = _NOTHING_TRIED
        self.settle_way(None)
        if self.special:
            self.forget_entry()  # of the machine of which this is a copy
        self._visits_before = self._visits + self._by_edges()

    @property
    def most_repeats(self) -> int:
        """Return how often it is repeated in a trial without a counted failure, at least once."""
        return max(1, self.settings.max_recoveries)

    def note_tried(self, what: str, successes: int) -> None:
        """Note what the oracle does after a failure. `successes`: in all, before it."""
        self._tried = what, successes

    def go_way(self, gone: WayResult, minutes: Callable[[], float]) -> None:
        """Note that a way on from its failure is gone. See `WayLog.go`.

        The next visit takes no short way, so that its result is noted.
        """
        with self._lock:
            self._ways.go(gone, minutes)
        self.retire_edges()

    def settle_way(self, helped: Optional[bool]) -> None:
        """Note the result of the way that is gone, where one is. None: nobody knows it."""
        # Almost every visit finds none, so it looks without the lock. That misses no way: one is
        # gone before the thread that comes here enters the state, and other threads only settle it.
        # Whoever reads the results waits for the lock.
        if self._ways.gone is not None:
            with self._lock:
                self._ways.settle(helped)

    def ways_so_far(self) -> Tuple[WayResult, ...]:
        """Return the results of the ways on from its failures, the latest ones, oldest first."""
        with self._lock:
            return tuple(self._ways.results)

    def ways_of_kinds(self) -> Mapping[Tuple[str, int], Count]:
        """Return how often ways of a kind at a place have helped, and how often not."""
        with self._lock:
            return self._ways.of_kinds.copy()

    def failure_key(self, kind: int, outcome: str, text: str) -> str:
        """Return the name of a kind of its failures. See `WayLog.failure_key`."""
        with self._lock:
            return self._ways.failure_key(kind, outcome, text)

    def left_by(self, outcome: str, target: str) -> None:
        """Count a transition that took no FastEdge."""
        self._edges[outcome, target] += 1

    def visit_ended(self) -> None:
        """Count a visit that ended without an FastEdge."""
        self._visits += 1

    def transitions(self) -> Dict[Tuple[str, str], int]:
        """Return how often each (outcome, target) was taken."""
        counts = self._edges.copy()
        for outcome, edge in dict(self.fast).items():
            counts[outcome, edge.leads_to] += edge.count
        return counts

    def restore(self, learned: Mapping[str, object]) -> None:
        """Take over what was learned.

        :raises ValueError: where it cannot be read.
        """
        with self._lock:
            self._up_to_date().restore(learned)
            self._ways.take_over(learned)

    def _by_edges(self) -> int:
        return self._retired + sum(map(_COUNT_OF, list(self.fast.values())))

    def __getstate__(self) -> Dict[str, object]:
        """Leave out what belongs to an execution under way, which may go on meanwhile."""
        state: Dict[str, object] = {**vars(self), 'snapshot': None, 'view': None, 'way_down': ()}
        state.update(fast=self.fast.copy(), _edges=self._edges.copy())
        with self._lock:
            state.update(_ways=self._ways.twin(), _estimator=copy.deepcopy(self._estimator))
        del state['_lock']
        return state

    def __setstate__(self, state: Dict[str, object]) -> None:
        self.__dict__.update(state)
        self._lock = threading.RLock()

    def begin_in_child(self) -> None:
        """Let nothing be under way in a forked child, where no thread lets go of the lock."""
        self._lock = threading.RLock()
        self.__setstate__(self.__getstate__())

    def retire_edges(self) -> None:
        """Forget all edges: the next visit takes no short way. Their counts stay."""
        for outcome in list(self.fast):
            self.retire_edge(outcome)

    def retire_edge(self, outcome: str) -> None:
        """Forget an edge whose transition has changed. Its counts stay."""
        with self._lock:
            edge = self.fast.pop(outcome)
            self._retired += edge.count
        if edge.count:
            self._edges[outcome, edge.leads_to] += edge.count
