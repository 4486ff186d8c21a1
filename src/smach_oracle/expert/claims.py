"""Claims of questions, renewed for as long as somebody works on them."""

import threading
from typing import Dict, NamedTuple, Optional, Protocol, Set

import rospy

from smach_oracle.ros.service_calls import ServerGoneError
from smach_oracle.srv import ClaimQueryRequest, ClaimQueryResponse

from .followed_server import ListedQuestion

LEASE_S = 15.0
# rounds in which a question was not open: it is over, and no server that is being restarted
MOST_MISSED = 12


class Claim(NamedTuple):
    """A question that an expert works on."""

    question: str  # its key
    expert: str


class ClaimServer(Protocol):
    """A server whose questions can be claimed, such as a FollowedServer."""

    def claim(self, query_id: str, expert: str, action: int, lease_s: float) -> ClaimQueryResponse:
        """Claim a question, or renew or release its claim.

        :raises ServerGoneError: if the server does not answer.
        """


class QuestionSource(Protocol):
    """The open questions and their servers, such as a FrontEnd knows them."""

    def find(self, key: str) -> Optional[ListedQuestion]:
        """Return one open question by its key, or None where it is open no longer."""

    def server(self, listed: ListedQuestion) -> ClaimServer:
        """Return the server of a question.

        :raises ServerGoneError: if it is followed no longer.
        """


class _KeptClaim(NamedTuple):
    listed: ListedQuestion
    holders: Set[int]


class ClaimKeeper:
    """Renews claims three times a lease until they are dropped or lost. Any thread.

    Several holders may have the same claim, such as two pages of one expert. Each is a number of
    the caller's choice.
    """

    def __init__(self, questions: QuestionSource, lease_s: float = LEASE_S) -> None:
        self._questions = questions
        self._lease_s = lease_s
        self._lock = threading.Lock()
        self._kept: Dict[Claim, _KeptClaim] = {}
        self._missed: Dict[Claim, int] = {}
        self._stopped = threading.Event()
        threading.Thread(target=self._run, name='keep claims', daemon=True).start()

    @property
    def held(self) -> Dict[Claim, ListedQuestion]:
        """Return the claims that are renewed, and their questions."""
        with self._lock:
            return {claim: kept.listed for claim, kept in self._kept.items()}

    def keep(self, listed: ListedQuestion, expert: str, holder: int = 0) -> None:
        """Renew a claim from now on."""
        claim = Claim(listed.key, expert)
        with self._lock:
            self._kept.setdefault(claim, _KeptClaim(listed, set())).holders.add(holder)

    def leave(self, claim: Claim, holder: int) -> bool:
        """Take a holder from a claim.

        Return whether no other is left, and it is renewed no longer.
        """
        with self._lock:
            kept = self._kept.get(claim)
            if kept is None:
                return True
            kept.holders.discard(holder)
            if not kept.holders:
                del self._kept[claim]
            return not kept.holders

    def leave_all(self, holder: int) -> None:
        """Take a holder from all claims. Those that no other holds run out."""
        for claim in self.held:
            self.leave(claim, holder)

    def drop(self, claim: Claim) -> bool:
        """Renew a claim no longer, whatever its holders.

        Return whether it was renewed until now.
        """
        with self._lock:
            return self._kept.pop(claim, None) is not None

    def stop(self) -> None:
        """Renew nothing any more."""
        self._stopped.set()

    def renew(self) -> None:
        """Renew all claims once. A server that hangs costs no claim of the others."""
        held = self.held
        for claim in set(self._missed) - set(held):
            del self._missed[claim]
        threads = [
            threading.Thread(target=self._renew, args=(claim,), name='renew', daemon=True)
            for claim in held
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()

    def _run(self) -> None:
        while not self._stopped.wait(self._lease_s / 3.0) and not rospy.is_shutdown():
            self.renew()

    def _renew(self, claim: Claim) -> None:
        """Drop a claim that is lost or whose question is closed. Keep it while its server hangs."""
        listed = self._questions.find(claim.question)
        # closed, or its server is being restarted: then its expert claims it again
        if listed is None:
            self._missed[claim] = self._missed.get(claim, 0) + 1
            if self._missed[claim] > MOST_MISSED:
                self.drop(claim)
            return
        self._missed.pop(claim, None)
        try:
            response = self._questions.server(listed).claim(
                listed.goal.query_id, claim.expert, ClaimQueryRequest.RENEW, self._lease_s
            )
        except ServerGoneError as err:
            rospy.logdebug('A claim was not renewed: %s', err)
            return
        if not response.ok:
            self.drop(claim)
