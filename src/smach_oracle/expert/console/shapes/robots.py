"""Robots and their machines as the server sends them."""

from typing import Dict, List, Literal, Optional, Tuple, TypedDict

from smach_oracle.analysis.graphs.drawn_graph import TransitionCount

from .basics import ByPath, ByState, FailureClass, HealthLevel

# the transition made last: from, to; from '': the oracle
LatestTransition = Tuple[str, str]
_Rated = TypedDict('_Rated', {'class': FailureClass})


class HeardView(TypedDict):
    """The time (s) since they were heard, when this was sent; None: never."""

    beat: float  # the console's monotonic clock
    master: Optional[float]
    servers: Dict[str, Optional[float]]
    robots: Dict[str, Optional[float]]  # by the name in questions


class LearnedRateView(_Rated):
    """The failure rate of a state, and what it was learned from."""

    rate: Optional[float]
    successes: int
    failures: int
    recoveries: int
    preconditions: bool


class FailedStateView(TypedDict):
    """The state of a container that has failed last, while its robot is at a loss."""

    state: str
    rate: Optional[float]


class LastWordView(TypedDict):
    """What a robot said last."""

    words: str
    at: float


class ActiveStateView(TypedDict):
    """A state that runs, or before which its container waits."""

    path: str
    state: str
    held: Literal['', 'paused', 'breakpoint', 'confirm']  # '': it runs
    confirm: bool  # it waits for a confirmation


class HeldMachineView(TypedDict):
    """A top-level machine as its operators see it, who may hold it."""

    path: str
    running: bool
    paused: bool
    by: str  # who has paused it, or 'breakpoint PATTERN'
    active: List[ActiveStateView]
    breakpoints: List[str]  # patterns


class LiveMachinesView(TypedDict):
    """What the containers of a robot do."""

    trial: str
    alive: bool
    unwell: str  # why it waits until it is well; '' where it does not
    last: Optional[LastWordView]
    active: ByPath[List[str]]
    latest: ByPath[LatestTransition]
    failed: ByPath[FailedStateView]
    rates: ByPath[ByState[LearnedRateView]]
    counts: ByPath[List[TransitionCount]]
    paths: List[str]
    control: Optional[List[HeldMachineView]]  # None: its machines cannot be held


class BatteryView(TypedDict):
    """A battery of a robot."""

    share: Optional[float]  # of its charge, 0 to 1; None: it does not say
    volts: Optional[float]
    charging: bool
    low: bool
    old: bool  # it has not been heard for a while


class HealthProblemView(TypedDict):
    """What diagnostics say of a part of a robot."""

    part: str
    level: HealthLevel
    message: str


class RobotHealthView(TypedDict):
    """The health of a robot of which anything is known."""

    battery: Optional[BatteryView]
    problems: List[HealthProblemView]  # the worst first


class DownMachineView(TypedDict):
    """A machine whose program has stopped, as its store has it; or why a store cannot be read."""

    key: str  # of the store and the trial
    store: str  # its file
    machine: str
    trial: int  # in the store
    moment: int  # the latest one of the trial
    states: List[str]  # where it can go on
    since: float  # when its program stored something last
    stood: List[str]  # where, in sentences
    questions: List[str]  # that were open
    userdata: List[Tuple[str, str, str]]  # container, key, JSON
    more_userdata: int  # keys that are left out
    command: str  # that shows more
    problem: str  # why the store cannot be read; '': it can, and all else is filled
