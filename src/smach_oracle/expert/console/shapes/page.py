"""The page as a whole: who uses it, and what the socket sends."""

from typing import Dict, List, Literal, Optional, Tuple, TypedDict, Union

from smach_oracle.analysis.graphs.drawn_graph import GraphView

from .basics import ByKey, ByState, Role
from .people import ActOverviewView, ActView, PeopleView, ReachView
from .questions import (
    InterfaceOutputView,
    KeptImageView,
    OnlookerView,
    PreconditionStatusView,
    QueryServerView,
    QuestionView,
)
from .robots import DownMachineView, HeardView, LiveMachinesView, RobotHealthView
from .sensors import ManipulationView, SensorListView
from .trials import (
    BagOverviewView,
    BagRestView,
    TrialEventView,
    TrialOverviewView,
    TrialRestView,
    TrialView,
)


class SessionView(TypedDict):
    """GET, POST and DELETE /session: who uses this browser."""

    signed_in: bool
    role: Union[Role, Literal['']]  # '' where nobody is signed in
    name: str  # '' where the person may choose
    tokens: bool  # whether one signs in here at all
    xsrf: str


# Named pieces of what the pages show; each comes whole, except the lists. A name in capital words
# stands for all that begin like it.
SectionsView = TypedDict(
    'SectionsView',
    {
        'heard': HeardView,
        'onlookers': ByKey[List[OnlookerView]],
        'questions': List[QuestionView],
        'servers': List[QueryServerView],
        'preconditions': ByKey[ByState[List[PreconditionStatusView]]],
        'images': ByKey[List[KeptImageView]],
        'replays': ByKey[int],  # numbers of what came before a failure: GET /replay/NUMBER
        'cameras': Dict[str, List[str]],  # of a robot, topics of its own, the likeliest first
        'robots': List[str],  # names of their nodes
        'health': Dict[str, RobotHealthView],  # by robot
        'down': List[DownMachineView],
        'trials': TrialOverviewView,
        'bags': BagOverviewView,
        'acts': ActOverviewView,
        'people': PeopleView,
        'sensors': SensorListView,
        'manipulation': ByKey[ManipulationView],
        'interface_output': ByKey[InterfaceOutputView],
        'reach': ReachView,  # only where there is an on-call list
        'live ROBOT': LiveMachinesView,
        'graph ROBOT PATH': GraphView,
    },
)


class _ChangedRows(TypedDict, total=False):
    all: Literal[True]  # no row of before is left
    gone: List[str]  # ids


class _ChangedTrials(_ChangedRows):
    rows: List[Tuple[str, TrialView]]  # with the id of the row before it; '': it is the first


class TrialsChangeView(_ChangedTrials, total=False):
    """What has changed in the list of live trials; only pages that look at it get this."""

    rest: TrialRestView  # what is beside the rows


class BagsChangeView(_ChangedTrials, total=False):
    """The same of the trials of bags."""

    rest: BagRestView


class _ChangedActs(_ChangedRows):
    rows: List[Tuple[str, ActView]]


class ActsChangeView(_ChangedActs, total=False):
    """The same of what people did."""

    rest: Dict[str, str]  # nothing


class ListChangesView(TypedDict, total=False):
    """What has changed in the lists."""

    trials: Optional[TrialsChangeView]  # None: it is gone
    bags: Optional[BagsChangeView]
    acts: Optional[ActsChangeView]


# Events of the trial that is watched, from a position on.
EventSliceView = TypedDict(
    'EventSliceView', {'trial': str, 'from': int, 'events': List[TrialEventView]}
)


SomeSections = Dict[str, object]  # of SectionsView; None: it is gone


class _BatchBase(TypedDict):
    now: float  # the server's clock


class BatchView(_BatchBase, total=False):
    """What has changed since the batch before."""

    all: Literal[True]  # what is not among the sections is gone
    sections: SomeSections
    lists: ListChangesView
    events: EventSliceView
