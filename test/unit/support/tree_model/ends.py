"""How a state ends in the model, and where a recovery leads."""

from typing import Any, Dict, NamedTuple, Optional, Set, Tuple


class Way(NamedTuple):
    """Where an outcome leads: to a state, to an outcome of the container, or nowhere ('')."""

    target: str
    is_state: bool


class Failed(NamedTuple):
    """A failure of a state, and how the container would end without an oracle."""

    label: str
    kind: str
    outcome: str
    way: Optional[Way]  # of the author
    ending: Optional[Way]  # None: it raises
    was_left: bool = False  # by a jump that cannot be gone on with
    told_by: str = ''  # a later state, which has reported it
    told_with: str = ''  # the outcome of that
    continuous: bool = False
    back_to: str = ''  # where a step back goes, as it was when the state had failed


class Goal(NamedTuple):
    """Where a machine goes that leaves containers."""

    machine: Any  # the innermost that holds both, or the level that gives up
    label: str = ''  # its state to go to
    begins: Dict[str, str] = {}  # labels that containers on the way down begin in, by path
    gives_up: Optional[str] = None  # an outcome
    failed: Optional[Failed] = None  # of its own state, where its oracle has decided
    written: Set[str] = frozenset()
    place: Tuple[str, str] = ('', '')  # where it ends
    crosses: bool = False  # containers were left
    repeats: Tuple[str, ...] = ()  # what it was said to repeat when it was decided


class Reply(NamedTuple):
    """What an expert answers."""

    kind: str  # goto, supersede, give_up
    path: str = ''
    name: str = ''  # state or outcome
    outputs: Dict[str, str] = {}
