"""One ExpertQuery server as a front end sees it: its open list, and calls to its services."""

import math
import time
from typing import Callable, FrozenSet, Iterable, List, NamedTuple, Optional

import genpy
import rospy

from smach_common.connections import sender_of
from smach_oracle.msg import ExpertDecision, ExpertQueryGoal, OpenQueries, OpenQuery
from smach_oracle.ros.senders.own_messages import is_named_after, publishers_of
from smach_oracle.ros.service_calls import CALL_LIMIT_S, ServerGoneError, ServiceCall
from smach_oracle.srv import (
    AnswerQuery,
    AnswerQueryRequest,
    AnswerQueryResponse,
    ClaimQuery,
    ClaimQueryRequest,
    ClaimQueryResponse,
)

RELEASE_LIMIT_S = 1.0  # nobody need wait for it: a claim that is not given back runs out
# after a call without an answer others fail at once for this long, then one tries again
_HANGING_S = 15.0


class ListedQuestion(NamedTuple):
    """An open question as last heard of. Times are this process's monotonic clock's, in seconds."""

    server: str
    goal: ExpertQueryGoal
    status: int  # OpenQuery.PENDING, CLAIMED or INTERFACE_RUNNING
    holder: str
    asked_s: float
    deadline_s: float  # infinity where it waits without end

    @property
    def key(self) -> str:
        """Return a key that tells questions of all servers apart."""
        return '{} {}'.format(self.server, self.goal.query_id)


class ListNews(NamedTuple):
    """The time at which a server spoke last."""

    came_s: float  # by this process's monotonic clock
    stamp_s: float  # by the server's ROS clock, or 0 where that does not run yet


class FollowedServer:
    """Follows the open list of one server and calls its services.

    Services are looked up at every call: a server that was restarted, or that has registered again
    with a new master, is found.
    """

    def __init__(self, name: str, on_change: Callable[[], None]) -> None:
        """
        :param name: resolved, e.g. /robot/expert_query.
        :param on_change: called in a ROS thread at every list.
        """
        self.name = name
        self._on_change = on_change
        self._questions: List[ListedQuestion] = []
        self._news: Optional[ListNews] = None
        self._node = ''  # that sent the list
        self._servers: FrozenSet[str] = frozenset()  # nodes that take answers, as the master has it
        self._unheard_since_s: Optional[float] = None
        self._unanswered: Optional[ServiceCall] = None
        self._subscriber = self._subscribe()

    @property
    def connected(self) -> bool:
        """Whether the server's process is there."""
        return any(map(self._is_server, publishers_of(self.name + '/open')))

    @property
    def news(self) -> Optional[ListNews]:
        """Return when its list came last, or None before the first.

        While a question is open the list comes every second.
        """
        return self._news

    def questions(self) -> List[ListedQuestion]:
        """Return the open questions, oldest first. The list is empty while the server is gone."""
        known = self._questions
        if self._node in publishers_of(self.name + '/open'):
            return list(known)
        if self._questions is known:
            self._questions = []  # the next server of this name has others
        return []

    def claim(
        self,
        query_id: str,
        expert: str,
        action: int = ClaimQueryRequest.CLAIM,
        lease_s: float = 0.0,
    ) -> ClaimQueryResponse:
        """Call the claim service.

        :raises ServerGoneError: if there is no such service now, or no answer within 5 s.
        """
        limit_s = RELEASE_LIMIT_S if action == ClaimQueryRequest.RELEASE else CALL_LIMIT_S
        return self._call(
            'claim', ClaimQuery, ClaimQueryRequest(action, query_id, expert, lease_s), limit_s
        )

    def answer(self, query_id: str, decision: ExpertDecision) -> AnswerQueryResponse:
        """Call the answer service. Asking the same twice does no harm.

        :raises ServerGoneError: if there is no such service now, or no answer within 5 s.
        """
        return self._call(
            'answer', AnswerQuery, AnswerQueryRequest(query_id, decision), CALL_LIMIT_S
        )

    def refresh(
        self, advertised: bool, servers: Iterable[str] = (), patience_s: float = 3.0
    ) -> None:
        """Subscribe again where the master knows the list and we do not hear it.

        We were registered with an earlier master, or its address has changed.

        :param servers: the nodes that take answers, as the master has it.
        """
        self._servers = frozenset(servers)
        if self.connected or not advertised:
            self._unheard_since_s = None
            return
        now_s = time.monotonic()
        if self._unheard_since_s is None:
            self._unheard_since_s = now_s
        elif now_s - self._unheard_since_s > patience_s:
            self._unheard_since_s = None
            self._subscriber.unregister()
            self._subscriber = self._subscribe()

    def stop(self) -> None:
        """Follow it no longer."""
        self._subscriber.unregister()

    def _subscribe(self) -> rospy.Subscriber:
        return rospy.Subscriber(
            self.name + '/open', OpenQueries, self._on_list, queue_size=2, tcp_nodelay=True
        )

    def _is_server(self, node: str) -> bool:
        """Whether a node takes the answers. One that plays a bag has questions and no ear."""
        return is_named_after(self.name, node) or node in self._servers

    def _on_list(self, message: OpenQueries) -> None:
        node = sender_of(message)
        if not self._is_server(node):
            return
        self._node = node
        now_s = time.monotonic()
        self._news = ListNews(now_s, message.header.stamp.to_sec())
        self._questions = [_listed(self.name, entry, now_s) for entry in message.queries]
        self._on_change()

    def _call(self, service: str, kind: type, request: object, limit_s: float) -> genpy.Message:
        name = '{}/{}'.format(self.name, service)
        hanging = self._unanswered
        if (
            hanging is not None
            and hanging.is_alive()
            and time.monotonic() - hanging.since_s < _HANGING_S
        ):
            raise ServerGoneError('{} does not answer'.format(name))
        call = ServiceCall(name, kind, request)
        try:
            return call.result(limit_s)
        finally:
            if call.is_alive():
                self._unanswered = call


def _listed(server: str, entry: OpenQuery, now_s: float) -> ListedQuestion:
    age_s = entry.age if math.isfinite(entry.age) else 0.0  # a server may say what it likes
    deadline_s = now_s + entry.remaining if entry.remaining >= 0 else math.inf
    return ListedQuestion(
        server, entry.query, entry.status, entry.claimed_by, now_s - age_s, deadline_s
    )
