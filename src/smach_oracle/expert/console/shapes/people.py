"""People as the server sends them: what they did, how long it took, their notes, whom it calls."""

from typing import List, Optional, Tuple, TypedDict

from .basics import ByKey, CallStatus

Times = Tuple[float, float]  # mean and longest, s


class ShiftNoteView(TypedDict):
    """A note for the next shift."""

    id: str
    at: float
    who: str
    text: str


class ShiftRowView(TypedDict):
    """The answers of a person in a shift."""

    who: str
    answered: int  # questions
    claim: Optional[Times]  # from the question on; None: nobody has claimed
    answer: Optional[Times]  # from the question on
    resume: Optional[Times]  # from the answer on, until the next state runs


class ShiftView(TypedDict):
    """A shift, with its people."""

    begin: float
    people: List[ShiftRowView]


class PeopleView(TypedDict):
    """The notes and the shifts."""

    since: float  # the console began: before that it has heard nothing
    kept: bool  # whether notes and times are in a file
    problem: str  # why that file cannot be read or written; '' where it can
    notes: List[ShiftNoteView]  # newest first
    shifts: List[ShiftView]  # newest first


class ActView(TypedDict):
    """A command that somebody gave."""

    id: str
    at: float
    who: str
    role: str
    client: str  # address of the browser
    console: str
    what: str
    robot: str
    ok: bool
    message: str


class ActOverviewView(TypedDict):
    """What people did last, newest first."""

    acts: List[ActView]


class CallView(TypedDict):
    """A call to a person about a question."""

    to: str  # person, and how
    status: CallStatus
    why: str  # it is not there yet, or never will be
    at: float


class NextCallView(TypedDict):
    """The people who are called next."""

    people: List[str]
    at: float


class FailedCallView(TypedDict):
    """A call that has not reached anybody."""

    to: str
    question: str
    why: str
    at: float


class ReachView(TypedDict):
    """Whom the console calls about open questions."""

    calls: ByKey[List[CallView]]
    next: ByKey[NextCallView]
    failed: List[FailedCallView]  # the newest last
