"""Trials as the server sends them: live ones, and those of bags."""

from typing import Dict, List, Optional, TypedDict

from smach_oracle.analysis.graphs.drawn_graph import GraphView

from .basics import ByPath, EventName, FailureClass, TrialEnd
from .questions import KeptImageView

_Failed = TypedDict('_Failed', {'class': FailureClass})


class TrialEventView(_Failed):
    """An event of a trial."""

    seq: int
    kind: EventName
    t: float
    path: str
    state: str
    outcome: str
    target: str
    rate: Optional[float]
    continuous: bool
    counted: bool  # false: of a transition that says nothing of how good its state is
    query: str  # id of the question
    by: str  # the expert
    text: str
    words: str  # what happened, in a sentence


class _TrialBase(TypedDict):
    id: str
    robot: str
    experiment: str
    start: float
    end: float
    # 'other': neither a success nor a failure by its outcome; '': it runs
    ending: TrialEnd
    outcome: str
    oracle: Optional[bool]  # whether it recovers; None: its bag does not say
    failures: int
    recoveries: int
    questions: int
    answered: int
    lost: int  # events that were not heard
    detailed: bool  # whether its events are kept


class TrialView(_TrialBase, total=False):
    """A trial, as the lists of them have it."""

    nth: int  # of its machine in its process, 0 where it is not known; not of a bag's trial
    number: int  # of a trial of a bag
    bag: str


class CountView(TypedDict):
    """The number of trials in which a thing happened, and how often it did in all."""

    trials: int
    events: Optional[int]


class TrialCountsView(TypedDict):
    """The counts of the things that happen in trials."""

    failures: CountView
    recoveries: CountView
    questions: CountView
    answered: CountView


class _EndingsBase(TypedDict):
    success: int
    failure: int
    preempted: int


class EndingsView(_EndingsBase, total=False):
    """The numbers of trials that ended in each way."""

    other: int  # only where there are some
    unfinished: int


class _CountsBase(TypedDict):
    experiment: str
    trials: int
    endings: EndingsView
    counts: TrialCountsView
    unwell_s: float  # in which they waited, all together, until the robot was well


class CountsRowView(_CountsBase, total=False):
    """A row of the paper's Table I."""

    oracle: bool  # of trials that were heard
    arm: str  # of trials of bags: the variant


class TrialRestView(TypedDict):
    """What comes with the list of live trials."""

    table: List[CountsRowView]
    heard: int


class TrialOverviewView(TrialRestView):
    """The live trials."""

    trials: List[TrialView]


class BrokenBagView(TypedDict):
    """A bag that cannot be read."""

    name: str
    reason: str


class BagRestView(TypedDict):
    """What comes with the list of trials of bags."""

    waiting: int  # bags that are still to be read
    note: str
    table: List[CountsRowView]
    broken: List[BrokenBagView]


class BagOverviewView(BagRestView):
    """The trials of bags."""

    trials: List[TrialView]


class RecordedTrialView(TypedDict):
    """GET /recorded/NUMBER: a trial of a bag."""

    events: List[TrialEventView]
    graphs: ByPath[GraphView]
    images: Dict[str, List[KeptImageView]]  # by the id of a question
    replays: Dict[str, int]  # by the number of a failure's event: GET /replay/NUMBER
