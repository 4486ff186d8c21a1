"""An open question as the server sends it, and what belongs to it."""

from typing import List, Literal, Optional, Tuple, TypedDict

from .basics import FailureClass, OutcomeMeaning, Role, Size

VisitResult = Literal['success', 'failure', 'superseded', 'preempted', '']
Missing = Literal['unheard', 'older', '']
QuestionStatus = Literal['pending', 'claimed', 'interface']
InterfaceStatus = Literal['starting', 'running', 'failed', 'stopped', '']
_Classed = TypedDict('_Classed', {'class': FailureClass})


class VisitView(TypedDict):
    """A visit of a state."""

    state: str
    outcome: str
    result: VisitResult


class LevelVisitsView(TypedDict):
    """A container around, as this console has heard of it."""

    path: str
    state: str  # that runs in it
    visits: List[VisitView]  # before it, oldest first
    missing: Missing  # what comes before these; '': nothing


class StateChoiceView(_Classed):
    """A state to go to."""

    state: str
    container: str  # path of another one than that of the failed state; '': that one
    success: Optional[float]  # predicted, 0 to 1
    visits: int  # in this trial
    missing: List[str]  # userdata that it needs and would not have
    preconditions: List[str]
    blocked: str  # why; '' where it is not
    repeats: List[str]  # states that are not repeated by themselves
    runs_again: List[str]  # branches of a Concurrence, which all run again
    helped: Tuple[int, int]  # how often going there helped, and how often it was tried
    helped_s: Optional[float]  # mean time until it did; None: only this console has counted
    recommended: str  # why; '' where it is not


class OutcomeChoiceView(TypedDict):
    """An outcome with which the failed state may count as done."""

    outcome: str
    target: str
    meaning: OutcomeMeaning


class LevelOutcomeView(TypedDict):
    """An outcome of a container above."""

    container: str
    outcome: str


class InterfaceOfferView(TypedDict):
    """A shared-autonomy interface that can be begun."""

    name: str
    description: str


class UserdataItemView(TypedDict):
    """A key of the userdata."""

    key: str
    type: str  # of a ROS message, with [] of a list of them; '' of plain data
    value: str  # JSON of plain data
    note: str  # why it is not shown


class QuestionView(_Classed):
    """An open question."""

    key: str  # tells questions of all robots apart
    server: str
    id: str  # at its server
    trial: str
    robot: str
    path: str  # of the container
    state: str  # that failed
    stands: str  # 'failed', 'still runs' or 'is held back', to follow its name
    what: str  # went wrong, in words
    running: bool  # it still runs: to go to it is to wait on
    outcome: str
    text: str  # of an exception
    rate: Optional[float]
    continuous: bool
    recoveries: int  # that were spent on it
    reason: str  # why the oracle asks
    tried: List[str]
    status: QuestionStatus
    holder: str  # the expert who has claimed it
    session: str  # of the holder's browser, in short; '': not by this console
    idle: int  # for how many periods its holder has pressed nothing; 0 of other claims
    interface: str  # that runs for it
    asked: float
    deadline: Optional[float]  # None: it waits without end
    fallback: str
    history: List[VisitView]  # of its container, as its robot knows it
    above: List[LevelVisitsView]  # the containers around it, the outermost first
    choices: List[StateChoiceView]
    supersede: List[OutcomeChoiceView]
    outputs: List[str]  # keys of the userdata that the state writes
    give_up: List[str]  # outcomes
    give_up_above: List[LevelOutcomeView]  # of the containers above
    interfaces: List[InterfaceOfferView]
    userdata: List[UserdataItemView]


class QueryServerView(TypedDict):
    """A server that questions come from."""

    name: str
    connected: bool


class PreconditionStatusView(TypedDict):
    """A precondition of a state to go to, as its robot has checked it."""

    name: str
    holds: Optional[bool]  # None: unknown
    text: str
    checked: Optional[float]  # when; None: never


class KeptImageView(TypedDict):
    """An image that the server keeps: what a camera gave when a question was put."""

    id: int
    topic: str
    late: Optional[float]  # s after the question, below 0 before; None: it is of the failure itself
    stamped: bool  # false: `late` is when it came
    size: Size


class InterfaceOutputView(TypedDict):
    """What an interface has printed."""

    status: InterfaceStatus
    text: str
    lines: List[str]


class OnlookerView(TypedDict):
    """A page that shows a question."""

    name: str  # '' where the person has given none
    role: Role
    session: str  # of its browser, in short
