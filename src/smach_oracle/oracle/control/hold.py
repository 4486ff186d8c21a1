"""A container that waits before a state, and how such a wait ends."""

from enum import Enum
from typing import NamedTuple

from ..scope.clock import Flag


class HeldBy(str, Enum):
    """The reason why a container waits."""

    PAUSE = 'paused'
    BREAKPOINT = 'breakpoint'
    CONFIRM = 'confirm'  # the autonomy of the state


class LetGo(str, Enum):
    """What an operator lets a container go by. A `Reason` may end its wait, too."""

    RESUMED = 'resumed'
    STEPPED = 'stepped'
    CONFIRMED = 'confirmed'
    SENT = 'sent'  # to another state


class HeldPlace(NamedTuple):
    """A state that is about to run, and the path of its container."""

    path: str
    state: str

    def in_words(self) -> str:
        """Return it as people read it."""
        return '{} in {}'.format(self.state, self.path)


class Hold:
    """One wait. `Control` alone writes to it."""

    __slots__ = (
        'place',
        'held_by',
        'confirms',
        'confirmed',
        'stepped',
        'may_be_sent',
        'asks',
        'autonomy',
        'key',
        'changed',
    )

    def __init__(self, place: HeldPlace, held_by: HeldBy, confirms: bool) -> None:
        self.place = place
        self.held_by = held_by
        self.confirms = confirms  # whether it waits for a confirmation
        self.confirmed = False
        self.stepped = False
        self.may_be_sent = True  # whether the container can go to another state from here
        self.asks = True  # whether the autonomy of its state counts
        self.autonomy = ''  # that by its settings
        self.key = place.path  # by which jumps of the container are asked for
        self.changed = Flag()  # an operator has asked for something since it was looked at

    @property
    def waits_for_confirmation(self) -> bool:
        """Whether nobody has confirmed yet that the state may be entered."""
        return self.confirms and not self.confirmed
