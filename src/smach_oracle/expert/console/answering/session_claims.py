"""The browser that holds each claim. Pure. Any thread may use it.

Robots know a claim by the expert's name alone, and two people may have the same. Here it belongs to
the session of one browser: another one of the same name neither shares it nor answers by it.
"""

import threading
import time
from collections import OrderedDict
from typing import NamedTuple, Optional

from smach_oracle.msg import OpenQuery

from ...followed_server import ListedQuestion
from ..commands.commands import PageCommand
from ..web.audit import Person
from ..web.settings import DEFAULT_IDLE_S

MOST_REMEMBERED = 1000
TOLD_WITHIN_S = 3.0  # after a claim its server's list has it
CLAIM_FIRST = 'Claim the question first, so that no two people work on it.'


class HeldClaim(NamedTuple):
    """The claim of one question."""

    session: str  # in short
    expert: str
    since_s: float  # monotonic, as the next one
    pressed_s: float  # when its holder was last known to press something

    def is_of(self, person: Person) -> bool:
        """Whether it is this browser's, under the name that the person has now."""
        return (self.session, self.expert) == (person.session, person.expert)


class SessionClaims:
    """The claims made through this console, by question."""

    def __init__(self, idle_s: float = DEFAULT_IDLE_S) -> None:
        """`idle_s`: a holder who presses nothing for so long is idle. 0: nobody ever is."""
        self._idle_s = idle_s
        self._lock = threading.Lock()
        self._held: 'OrderedDict[str, HeldClaim]' = OrderedDict()

    def session_of(self, listed: ListedQuestion) -> str:
        """Return the session whose claim its server lists, or '' where that was not made here."""
        held = self._held.get(listed.key)
        return held.session if held is not None and held.expert == listed.holder else ''

    def holds(self, person: Person, listed: ListedQuestion) -> bool:
        """Whether this browser holds the claim, under the name that the person has now."""
        held = self._valid(listed)
        return held is not None and held.is_of(person)

    def note_press(self, person: Person, listed: ListedQuestion) -> None:
        """Its holder has pressed something. Of others nothing is noted."""
        with self._lock:
            held = self._held.get(listed.key)
            if held is not None and held.is_of(person):
                self._held[listed.key] = held._replace(pressed_s=time.monotonic())

    def idle_periods(self, listed: ListedQuestion) -> int:
        """Return for how many whole periods the holder has pressed nothing, 0 of other claims."""
        held = self._held.get(listed.key)
        if not self._idle_s or held is None or held.expert != listed.holder:
            return 0
        return int((time.monotonic() - held.pressed_s) / self._idle_s)

    def waits(self, listed: ListedQuestion) -> bool:
        """Whether a question waits: nobody works on it, or its holder presses nothing."""
        return listed.status == OpenQuery.PENDING or (
            listed.status == OpenQuery.CLAIMED and self.idle_periods(listed) > 0
        )

    def refusal(self, command: PageCommand, person: Person, listed: ListedQuestion) -> str:
        """Return why a claim or an answer is not the person's, or '' where it may be."""
        if command.name == 'claim':
            held = self._valid(listed)
            if held is not None and held.expert == person.expert and held.session != person.session:
                return '{} works on this question in another browser'.format(held.expert)
        if command.name == 'answer' and not self.holds(person, listed):
            others = listed.holder and (listed.holder != person.expert or self._valid(listed))
            return (
                '{} works on this question; take it over first'.format(listed.holder)
                if others
                else CLAIM_FIRST
            )
        return ''

    def take(self, person: Person, listed: ListedQuestion) -> None:
        """The claim is this browser's from now on. A page makes it again without any press."""
        now_s = time.monotonic()
        with self._lock:
            held = self._held.get(listed.key)
            pressed_s = held.pressed_s if held is not None and held.is_of(person) else now_s
            self._held[listed.key] = HeldClaim(person.session, person.expert, now_s, pressed_s)
            self._held.move_to_end(listed.key)
            while len(self._held) > MOST_REMEMBERED:
                self._held.popitem(last=False)

    def give_back(self, person: Person, listed: ListedQuestion) -> None:
        """The claim is nobody's, where it was this browser's."""
        with self._lock:
            held = self._held.get(listed.key)
            if held is not None and held.session == person.session:
                del self._held[listed.key]

    def _valid(self, listed: ListedQuestion) -> Optional[HeldClaim]:
        """The claim, unless it has run out at the server, or was taken over elsewhere."""
        held = self._held.get(listed.key)
        if held is None:
            return None
        fresh = time.monotonic() - held.since_s < TOLD_WITHIN_S
        return held if fresh or listed.holder == held.expert else None
