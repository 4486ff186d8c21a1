"""The ROS part of every front end for experts: open questions, claims and answers."""

import threading
import time
from types import MappingProxyType
from typing import Dict, List, Mapping, Optional, Sequence

import rosgraph
import rospy

from smach_oracle.msg import ExpertDecision, OpenQueries, OpenQuery
from smach_oracle.ros.master_watch import timed_master
from smach_oracle.ros.service_calls import ServerGoneError
from smach_oracle.srv import AnswerQueryResponse, ClaimQueryRequest, ClaimQueryResponse

from .claims import LEASE_S, Claim, ClaimKeeper
from .followed_server import FollowedServer, ListedQuestion, ListNews

_DISCOVERY_PERIOD_S = 2.0
_FORGET_S = 600.0  # after which a server that was found, and is gone, is followed no longer
# for giving back claims at the end. A server or master that hangs does not hold it up
_FAREWELL_S = 1.0


class FrontEnd:
    """Open questions, claims and answers for one expert. May be used from any thread.

    Without names of servers it follows every topic of type smach_oracle/OpenQueries that the master
    knows, now or later.
    """

    def __init__(self, expert: str, servers: Sequence[str] = (), lease_s: float = LEASE_S) -> None:
        """Follow servers from now on.

        :param expert: the name under which to claim and answer.
        :param servers: names such as /robot/expert_query.
        """
        self.expert = expert
        self._discover = not servers
        self._lease_s = lease_s
        self._changed = threading.Condition()
        self._version = 0
        self._servers: Dict[str, FollowedServer] = {}
        self._gone_since_s: Dict[str, float] = {}
        self._stopped = threading.Event()
        for name in servers:
            self._follow(rospy.resolve_name(name))
        self._claims = ClaimKeeper(self, lease_s)
        threading.Thread(target=self._keep_connected, daemon=True, name='keep connected').start()

    @property
    def servers(self) -> List[str]:
        """Return the names of the servers followed, sorted."""
        return sorted(self._servers)

    def connected(self, server: str) -> bool:
        """Whether the server is there now."""
        followed = self._servers.get(server)
        return followed is not None and followed.connected

    def news(self, server: str) -> Optional[ListNews]:
        """Return when the server's list came last, or None before the first."""
        followed = self._servers.get(server)
        return followed.news if followed is not None else None

    def questions(self) -> List[ListedQuestion]:
        """Open questions of all servers, oldest first."""
        found = [listed for server in list(self._servers.values()) for listed in server.questions()]
        return sorted(found, key=lambda listed: (listed.asked_s, listed.key))

    def find(self, key: str) -> Optional[ListedQuestion]:
        """Return one open question by its key, None where it is open no longer."""
        return next((listed for listed in self.questions() if listed.key == key), None)

    def wait_for_change(self, version: int, timeout_s: float) -> int:
        """Block until a list has come since `version`, or the time is over.

        :param version: returned by an earlier call. Begin with 0.
        """
        with self._changed:
            self._changed.wait_for(
                lambda: self._version != version or self._stopped.is_set(), timeout_s
            )
            return self._version

    def claim(self, listed: ListedQuestion, take_over: bool = False) -> ClaimQueryResponse:
        """Claim a question, and keep the claim alive until it is answered, released or lost.

        :raises ServerGoneError: if its server cannot be reached.
        """
        action = ClaimQueryRequest.TAKE_OVER if take_over else ClaimQueryRequest.CLAIM
        response = self.server(listed).claim(
            listed.goal.query_id, self.expert, action, self._lease_s
        )
        if response.ok:
            self._claims.keep(listed, self.expert)
        return response

    def release(self, listed: ListedQuestion) -> None:
        """Give a claim back. A server that cannot be reached lets it run out."""
        if not self._claims.drop(Claim(listed.key, self.expert)):
            return
        try:
            self.server(listed).claim(listed.goal.query_id, self.expert, ClaimQueryRequest.RELEASE)
        except ServerGoneError as err:
            rospy.logdebug('A claim was not given back: %s', err)

    def answer(self, listed: ListedQuestion, decision: ExpertDecision) -> AnswerQueryResponse:
        """Settle a question under this expert's name. A refused answer leaves a claim as it is.

        :raises ServerGoneError: if its server cannot be reached. The same answer may be sent again.
        """
        decision.by = self.expert
        response = self.server(listed).answer(listed.goal.query_id, decision)
        if response.ok:
            self._claims.drop(Claim(listed.key, self.expert))
        return response

    def stop(self) -> None:
        """Give all claims back and follow nothing any more, within a second."""
        self._stopped.set()
        self._claims.stop()
        farewell = threading.Thread(target=self._take_leave, daemon=True, name='farewell')
        farewell.start()
        farewell.join(_FAREWELL_S)
        self._notify()

    def _take_leave(self) -> None:
        for listed in self._claims.held.values():
            self.release(listed)
        for server in list(self._servers.values()):
            server.stop()

    def server(self, listed: ListedQuestion) -> FollowedServer:
        """Return the server of a question, for front ends that serve several experts.

        :raises ServerGoneError: where it has been gone for so long that it is followed no longer.
        """
        followed = self._servers.get(listed.server)
        if followed is None:
            raise ServerGoneError('{} is gone'.format(listed.server))
        return followed

    def _follow(self, name: str) -> None:
        self._servers[name] = FollowedServer(name, self._notify)

    def _notify(self) -> None:
        with self._changed:
            self._version += 1
            self._changed.notify_all()

    def _keep_connected(self) -> None:
        while not rospy.is_shutdown():
            try:
                master = timed_master()
                self._look_for_servers(
                    master.getPublishedTopics(''), dict(master.getSystemState()[2])
                )
            except (OSError, rosgraph.MasterException) as err:
                rospy.logdebug('The master does not answer: %s', err)
            if self._stopped.wait(_DISCOVERY_PERIOD_S):
                return

    def _look_for_servers(
        self,
        published: Sequence[Sequence[str]],
        services: Mapping[str, Sequence[str]] = MappingProxyType({}),
    ) -> None:
        lists = {
            topic
            for topic, kind in published
            if kind == OpenQueries._type and topic.endswith('/open')
        }
        if self._discover:
            for topic in sorted(lists):
                name = topic[: -len('/open')]
                if name not in self._servers:
                    self._follow(name)
        for name, server in dict(self._servers).items():
            server.refresh(name + '/open' in lists, services.get(name + '/answer', ()))
            if self._discover:
                self._forget_gone(name, server, name + '/open' in lists)

    def _forget_gone(self, name: str, server: FollowedServer, advertised: bool) -> None:
        """Robots with names of the moment come and go for days."""
        if advertised or server.connected:
            self._gone_since_s.pop(name, None)
        elif time.monotonic() - self._gone_since_s.setdefault(name, time.monotonic()) > _FORGET_S:
            del self._servers[name], self._gone_since_s[name]
            server.stop()


def wait_for_question(front_end: FrontEnd, timeout_s: float) -> Optional[ListedQuestion]:
    """Wait for a question that nobody works on (PENDING).

    :returns: the oldest one, None where none came in time.
    """
    until_s = time.monotonic() + timeout_s
    version = 0
    while not rospy.is_shutdown():
        pending = next(
            (each for each in front_end.questions() if each.status == OpenQuery.PENDING), None
        )
        left_s = until_s - time.monotonic()
        if pending is not None or left_s <= 0.0:
            return pending
        version = front_end.wait_for_change(version, min(0.5, left_s))
    return None
