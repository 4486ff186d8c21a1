"""The browser that holds each claim. Pure. Any thread may use it.

Robots know a claim by the expert's name alone, and two people may have the same. Here it belongs to
the session of one browser: another one of the same name neither shares it nor answers by it.
"""

import threading
import time
from collections import OrderedDict
from typing import NamedTuple, Optional

from ...followed_server import ListedQuestion
from ..commands.commands import PageCommand
from ..web.audit import Person

MOST_REMEMBERED = 1000
TOLD_WITHIN_S = 3.0  # after a claim its server's list has it
CLAIM_FIRST = 'Claim the question first, so that no two people work on it.'


class HeldClaim(NamedTuple):
    """The claim of one question."""

    session: str  # in short
    expert: str
    since_s: float  # monotonic


class SessionClaims:
    """The claims made through this console, by question."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._held: 'OrderedDict[str, HeldClaim]' = OrderedDict()

    def session_of(self, listed: ListedQuestion) -> str:
        """Return the session whose claim its server lists, or '' where that was not made here."""
        held = self._held.get(listed.key)
        return held.session if held is not None and held.expert == listed.holder else ''

    def holds(self, person: Person, listed: ListedQuestion) -> bool:
        """Whether this browser holds the claim, under the name that the person has now."""
        held = self._valid(listed)
        return held is not None and (held.session, held.expert) == (person.session, person.expert)

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
        """The claim is this browser's from now on."""
        with self._lock:
            self._held[listed.key] = HeldClaim(person.session, person.expert, time.monotonic())
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
